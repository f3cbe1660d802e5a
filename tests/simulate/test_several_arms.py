"""Several arms in one patient: each is what it is alone, contact between them ends the run."""

import dataclasses

import mujoco
import numpy as np
import pytest

from surgsim.errors import Outcome, ScenarioError, SurgsimError, UnknownNameError
from surgsim.models.build import SharedArm, build_shared
from surgsim.plant.between import arms_are_clear, touching_pair
from surgsim.scenario.arms import experiment_of
from surgsim.scenario.load import load_experiment, load_scenario
from surgsim.simulate.loop import Simulation, prepared, simulate

TASK = {"duration_s": 0.4, "ramp_s": 0.15, "hold_start_s": 0.0, "hold_end_s": 0.0, "radius_m": 0.005}
FAR_M = 3.0
DISTURBED = [
    {"type": "payload", "spread": 0.3},
    {"type": "sensor_noise"},
    {"type": "breathing", "random_phase": True, "ramp_s": 0.2},
]


def arm(name, robot, x, duration_s=0.4, **more):
    """An arm at its usual circle, everything `x` [m] to the side."""
    own = load_scenario(f"circle_{robot}").resolved()
    port, start = own["trocar"]["position_m"], own["task"]["start_m"]
    return {
        "name": name,
        "robot": {"name": robot, "base_position_m": [x, 0.0, 0.0]},
        "trocar": {"position_m": [port[0] + x, *port[1:]], **more.pop("trocar", {})},
        "start": {"posture_rad": own["start"]["posture_rad"]},
        "task": {"type": "circle", **TASK, "duration_s": duration_s, "start_m": [start[0] + x, *start[1:]]},
        "controller": "rcm_inverse_dynamics",
        **more,
    }


def apart(**more):
    """Two arms that cannot reach each other; the second has longer to go."""
    arms = [arm("left", "lwr4plus", 0.0), arm("right", "panda", FAR_M, duration_s=0.5)]
    return load_experiment({"name": "apart", "theatre": False, "arms": arms, **more})


def assert_same(one, alone, tolerance):
    """The arm in company and the arm alone, for as long as the latter runs."""
    assert one.columns == alone.columns
    rows = len(alone) - 1  # in the last one the arm alone is not asked to go on
    for block in alone.blocks:
        if block.name != "control_time":
            np.testing.assert_allclose(
                one.block(block.name)[:rows],
                alone.block(block.name)[:rows],
                rtol=0.0,
                atol=tolerance,
                equal_nan=True,
                err_msg=block.name,
            )


@pytest.mark.parametrize("more", [{}, {"disturbances": DISTURBED, "seed": 3}], ids=["ideal", "disturbed"])
def test_two_arms_that_do_not_meet_are_what_each_is_alone(more):
    scenario = apart(**more)
    trace = simulate(scenario)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert trace.arms == scenario.names == ("left", "right")
    for name in scenario.names:
        assert_same(trace.of(name), simulate(scenario.of(name)), 1e-9)


def test_arms_that_follow_velocities_are_what_each_is_alone():
    """To the last bit, but that the arm that is done first goes on."""
    scenario = apart(plant={"type": "kinematic"})
    trace = simulate(scenario)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    for name in scenario.names:
        assert scenario.of(name).plant.type == "kinematic"
        assert_same(trace.of(name), simulate(scenario.of(name)), 0.0)
    assert np.isnan(trace["left_tau1_nm"]).all()
    assert trace.of("right")["tip_error_m"].max() < 1e-4
    again = experiment_of(scenario.resolved())
    assert simulate(again).equals(trace)
    simulation = Simulation(prepared(scenario))
    simulation.advance(100)
    assert simulation.fork().run().equals(trace)


def test_arms_that_follow_velocities_meet_where_those_with_dynamics_do(crossed):
    scenario = load_experiment(
        "safety/arm_collision", assignments=["theatre=false", "plant={type: kinematic}"]
    )
    trace = simulate(scenario)
    assert trace.meta.ending.outcome is Outcome.ARM_COLLISION
    assert trace.meta.ending.t_s == pytest.approx(crossed.meta.ending.t_s, abs=0.005)
    assert trace["left_stopped"].sum() == 0.0


def test_the_usual_plant_is_no_part_of_the_hash():
    usual, other = apart(), apart(plant={"type": "kinematic"})
    assert "plant" not in usual.resolved()
    assert usual.sha256() == apart(plant={"type": "dynamic"}).sha256() != other.sha256()
    assert other.resolved()["plant"] == {"type": "kinematic"}


def test_walls_and_real_drives_are_each_arms_own():
    walled = arm("left", "lwr4plus", 0.0, trocar={"wall": {}}, controller="rcm_elastic_dynamics")
    walled["robot"]["drive"] = "real"
    scenario = load_experiment(
        {"name": "walled", "theatre": False, "arms": [walled, arm("right", "panda", FAR_M)]}
    )
    trace = simulate(scenario)
    assert_same(trace.of("left"), simulate(scenario.of("left")), 1e-9)
    assert {"left_trocar_force", "left_cannula_x"} <= {block.name for block in trace.blocks}
    assert "right_trocar_force" not in trace


def test_each_arm_has_its_own_energy_ledger():
    """Wall, friction and a payload beside another arm that moves: the books are those of the arm alone."""
    given = [{"type": "joint_friction"}, {"type": "payload", "mass_kg": 0.3}]
    walled = arm("left", "lwr4plus", 0.0, trocar={"wall": {}}, disturbances=given)
    scenario = apart(
        arms=[walled, arm("right", "panda", FAR_M, duration_s=0.5)],
        plant={"type": "dynamic", "energy_ledger": True},
    )
    trace = simulate(scenario)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    for name in scenario.names:
        assert_same(trace.of(name), simulate(scenario.of(name)), 1e-9)
        moved = np.abs(trace[f"{name}_energy_actuator_work_j"]).max()
        assert np.abs(trace[f"{name}_energy_residual_j"]).max() < 1e-3 * moved
    assert trace["left_energy_friction_loss_j"][-1] > 0.0 == trace["right_energy_friction_loss_j"][-1]


def test_the_run_goes_on_until_every_task_is_done_and_the_others_hold():
    trace = simulate(apart())
    assert trace["t_s"][-1] == pytest.approx(0.5)
    late = trace.of("left").block("tip_ref")[-90:]
    assert np.ptp(late, axis=0).max() == 0.0
    assert trace.of("left")["tip_error_m"][-1] < 1e-5


def test_the_seed_draws_the_same_again_and_for_each_arm_something_else():
    twins = [arm("left", "lwr4plus", 0.0), arm("right", "lwr4plus", FAR_M)]
    content = {"name": "twins", "theatre": False, "arms": twins, "disturbances": DISTURBED, "seed": 5}
    scenario = load_experiment(content)
    trace = simulate(scenario)
    assert trace.equals(simulate(scenario))
    assert scenario.of("left").seed != scenario.of("right").seed
    left, right = (trace.of(name).block("q") for name in trace.arms)
    assert np.abs(left[-1] - right[-1]).max() > 1e-6


def test_the_motion_of_one_port_does_not_move_the_other_arm():
    still, moved = (
        simulate(apart(arms=[arm("left", "lwr4plus", 0.0, disturbances=given), arm("right", "panda", FAR_M)]))
        for given in ([], [{"type": "breathing", "ramp_s": 0.1, "rate_hz": 2.0}])
    )
    assert np.ptp(moved.block("left_trocar"), axis=0).max() > 1e-3
    np.testing.assert_array_equal(moved.block("right_trocar"), still.block("right_trocar"))
    assert_same(moved.of("right"), still.of("right"), 1e-12)


@pytest.fixture(scope="module")
def crossed():
    """The shaft of one arm is led into that of another."""
    return simulate(load_experiment("safety/arm_collision", assignments=["theatre=false"]))


def in_contact(trace, row):
    """Whether MuJoCo sees contact of the two shafts where the trace says that they are."""
    spec = mujoco.MjSpec()
    for name in trace.arms:
        one = trace.of(name)
        tip, entry = one.block("tip")[row], one.block("wrist")[row]
        end = tip + 0.004 * (entry - tip) / np.linalg.norm(entry - tip)
        body = spec.worldbody.add_body()
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*entry, *end], size=[0.004, 0.0, 0.0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data.ncon > 0


def test_contact_between_arms_ends_the_run_in_the_tick_in_which_mujoco_sees_it(crossed):
    ending = crossed.meta.ending
    assert ending.outcome is Outcome.ARM_COLLISION
    assert ending.detail.startswith("left's shaft touches right's shaft, ")
    active = crossed.active()
    assert active["t_s"][-1] == ending.t_s
    assert in_contact(active, len(active) - 1)
    assert not in_contact(active, len(active) - 2)


def test_contact_that_is_not_to_end_a_run_does_not():
    watched = [f"arms.0.safety={{stop_at_collision: {flag}}}" for flag in ("true", "false")]
    ends = [
        simulate(load_experiment("safety/arm_collision", assignments=["theatre=false", keys])).meta.ending
        for keys in watched
    ]
    assert [end.outcome for end in ends] == [Outcome.ARM_COLLISION, Outcome.COMPLETED]


def test_what_is_not_looked_at_again_touches_nothing():
    """Along random motions the kernel with a memory says what a look at everything says."""
    setup = prepared(load_experiment("safety/arm_collision", assignments=["theatre=false"]))
    rng = np.random.default_rng(0)
    model, data, record = setup.arms["left"].scene.model, setup.data, setup.watch.record
    touched = 0
    for _ in range(8):
        for one in setup.arms.values():
            data.qpos[one.scene.qpos_ids] = one.q_start
        speed = rng.uniform(-1.0, 1.0, model.nq) * 2e-3
        for _ in range(300):
            data.qpos[:] += speed
            mujoco.mj_kinematics(model, data)
            clear = arms_are_clear(record)
            assert clear == (touching_pair(record)[1] < 0)
            touched += not clear
    assert touched > 10


def test_a_limit_of_one_arm_ends_the_run_for_both_and_says_whose_it_is():
    trace = simulate(apart(arms=[arm("left", "lwr4plus", 0.0), limited("right")]))
    ending = trace.meta.ending
    assert ending.outcome is Outcome.TIP_LIMIT
    assert ending.detail.startswith("arm right: tip 0.0")
    stopped = [trace.of(name).stop() for name in trace.arms]
    assert [len(stop) for stop in stopped] == [501, 501]
    assert all(np.abs(stop.block("v")[-1]).max() < 0.02 for stop in stopped)


def limited(name):
    """An arm with a limit of its own, which it passes."""
    return arm(name, "panda", FAR_M, safety={"tip_error_max_m": 1e-7})


def test_a_stored_run_goes_on_with_the_same_bits():
    scenario = apart(disturbances=DISTURBED)
    whole = simulate(scenario)
    simulation = Simulation(prepared(scenario))
    simulation.advance(150)
    stored, fork = simulation.snapshot(), simulation.fork()
    simulation.advance(100)
    simulation.restore(stored)
    assert simulation.run().equals(whole)
    assert fork.run().equals(whole)
    with pytest.raises(SurgsimError, match="another scenario"):
        Simulation(prepared(apart())).restore(stored)
    with pytest.raises(SurgsimError, match="several arms has no single state"):
        simulation.state  # noqa: B018


def test_arms_of_other_numbers_of_joints_share_a_model():
    scenario = apart()
    scenes = build_shared(
        [SharedArm(name=n, config=scenario.of(n).scene) for n in scenario.names], drawn=False
    )
    assert scenes[0].model is scenes[1].model
    assert [scene.qpos_ids.tolist() for scene in scenes] == [[*range(7)], [*range(7, 14)]]
    assert [scene.port_mocap for scene in scenes] == [0, 1]
    for scene, name in zip(scenes, scenario.names, strict=True):
        alone = dataclasses.asdict(prepared(scenario.of(name)).scene.limits)
        for key, values in dataclasses.asdict(scene.limits).items():
            np.testing.assert_array_equal(values, alone[key])


def test_arms_that_touch_at_the_start_are_refused_with_both_names():
    close = [arm("left", "lwr4plus", 0.0), arm("right", "lwr4plus", 0.05)]
    with pytest.raises(SurgsimError, match="close: the arms touch at the start: left's base touches right's"):
        prepared(load_experiment({"name": "close", "theatre": False, "arms": close}))


REFUSED = {
    "props": ({"props": []}, "props: not beside arms: what an arm grasps or touches is for one arm alone"),
    "kinematic": (
        {"plant": {"type": "kinematic"}, "disturbances": [{"type": "payload"}]},
        "disturbances do not act on the 'kinematic' plant: leave them out",
    ),
    "robot": ({"robot": {"name": "panda"}}, "robot: not beside arms: give it to each of the arms, as arms.0"),
    "one": ({"arms": [arm("left", "panda", 0.0)]}, "arms: "),
    "names": (
        {"arms": [arm("a", "panda", 0.0), arm("a_b", "panda", FAR_M)]},
        "arms.1.name: 'a_b' and 'a' can",
    ),
    "inside": (
        {"arms": [arm("a", "panda", 0.0), arm("b", "panda", FAR_M, instrument=None)]},
        "arms.1: a trocar needs an instrument",
    ),
}


@pytest.mark.parametrize(("more", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_said_of_several_arms_is_refused_with_its_key(more, said):
    with pytest.raises(ScenarioError) as raised:
        apart(**more)
    assert said in str(raised.value)
    assert "\n" not in str(raised.value)


def test_what_is_for_one_arm_says_so():
    with pytest.raises(ScenarioError, match="arms: a scenario of one arm is needed here"):
        load_scenario("two_ports_panda")
    with pytest.raises(UnknownNameError, match=r"'top' is not an arm of this scenario\. Known: "):
        apart().of("top")


def test_a_path_out_of_reach_names_its_arm():
    far = arm("right", "panda", FAR_M)
    far["task"]["start_m"][2] = 0.1
    scenario = apart(arms=[arm("left", "lwr4plus", 0.0), {**far, "task": {**far["task"], "radius_m": 0.3}}])
    with pytest.raises(SurgsimError, match=r"^apart: arm right: "):
        prepared(scenario)


@pytest.mark.parametrize("robot", ["lwr4plus", "panda"])
def test_the_tools_path_stays_in_the_endoscopes_picture(robot):
    scenario = load_experiment(f"endoscope_and_tool_{robot}", assignments=["theatre=false"])
    setup = prepared(scenario)
    tip = setup.arms["tool"].task.command
    scope, data = setup.arms["endoscope"], setup.data
    lens = scope.scene.parts.find(mujoco.mjtObj.mjOBJ_CAMERA, "lens")
    for one in setup.arms.values():
        data.qpos[one.scene.qpos_ids] = one.q_start
    mujoco.mj_kinematics(scope.scene.model, data)
    mujoco.mj_camlight(scope.scene.model, data)
    axes, place = data.cam_xmat[lens].reshape(3, 3), data.cam_xpos[lens]
    half = 0.5 * np.deg2rad(scope.scene.model.cam_fovy[lens])
    for t in np.linspace(0.0, setup.duration_s, 60):
        seen = axes.T @ (tip(t).p_WTd - place)
        assert seen[2] < -0.05
        assert np.arctan2(np.linalg.norm(seen[:2]), -seen[2]) < 0.8 * half
    shaft = scope.arm.kinematics(scope.q_start).R_WT[:, 2]
    off_shaft = np.rad2deg(np.arctan2(np.linalg.norm(np.cross(axes[:, 2], shaft)), -axes[:, 2] @ shaft))
    assert off_shaft == pytest.approx({"lwr4plus": 0.0, "panda": 30.0}[robot], abs=0.01)
