"""The start is solved through the trocar; what is out of reach is refused with the reason."""

import re

import mink
import numpy as np
import pytest

from surgsim.control.mink_tasks import RcmTask
from surgsim.control.rcm import rcm_kinematics
from surgsim.errors import SurgsimError, UnreachableError
from surgsim.models.arm import ArmModel
from surgsim.models.config import InstrumentConfig, RobotConfig, SceneConfig, TrocarConfig
from surgsim.plant.disturbances import DISTURBANCES
from surgsim.scenario.load import load_scenario, of_one_arm, shipped
from surgsim.simulate.posture import near_posture
from surgsim.simulate.reach import LIMIT_MARGIN_RAD, Reach
from surgsim.simulate.setup import prepare
from surgsim.simulate.start import check_through_port, solve_start

GIVEN = "start.q_rad=[1.5708, 0.5236, 0.0, -1.5708, 0.0, 1.0472, 0.0]"


def _assert_starts_well(setup):
    s, arm = setup.scenario, setup.arm
    kin = arm.kinematics(setup.q_start)
    assert np.linalg.norm(kin.p_WT - np.array(s.task.start_m)) < 1e-6
    assert np.linalg.norm(rcm_kinematics(kin, np.array(s.trocar.position_m), np.zeros(3)).error) < 1e-6
    assert (setup.q_start > arm.limits.q_min).all()
    assert (setup.q_start < arm.limits.q_max).all()


@pytest.mark.parametrize("name", of_one_arm(shipped()))
def test_every_shipped_scenario_starts_on_its_path_with_the_shaft_through_the_trocar(name):
    _assert_starts_well(prepare(load_scenario(name, assignments=["theatre=false"])))


def _solved(arm, scene, *places, posture=None, clear=True):
    middle = 0.5 * (arm.limits.q_min + arm.limits.q_max)
    return solve_start(arm, scene, np.array(places), posture=posture, home=middle, clear=clear)


@pytest.mark.parametrize("seed", range(3))
def test_starts_all_over_the_workspace_are_solved_near_the_posture(arm, seed):
    rng = np.random.default_rng(seed)
    p_WC = (0.0, 0.55, 0.2)
    scene = SceneConfig(robot=RobotConfig(name="lwr4plus"), trocar=TrocarConfig(position_m=p_WC))
    p_WT = np.array(p_WC) + rng.uniform([-0.06, -0.06, -0.2], [0.06, 0.06, -0.1])
    posture = np.array([1.5708, 0.5236, 0.0, -1.5708, 0.0, 1.0472, 0.0])
    q = _solved(arm, scene, p_WT, posture=posture)
    assert max(Reach(arm, scene).miss(q, p_WT)) < 1e-6


@pytest.mark.parametrize("posture", [None, np.full(7, 0.3)])
def test_without_a_trocar_the_tip_alone_is_placed(arm, posture):
    scene = SceneConfig(robot=RobotConfig(name="lwr4plus"))
    q = _solved(arm, scene, np.array([0.3, 0.4, 0.3]), posture=posture)
    np.testing.assert_allclose(arm.kinematics(q).p_WT, [0.3, 0.4, 0.3], atol=1e-6)


NEAR_A_LIMIT = (
    "task.radius_m=0.05",
    "task.duration_s=4",
    "task.ramp_s=1",
    "task.start_m=[0.05, 0.55, 0.02]",
    "start.posture_rad=[2.044, -0.868, -2.452, -1.823, 1.673, 1.556, 0.57]",
)


def _room(setup):
    """Smallest distance to a joint limit on the path, which is followed with the pseudo-inverse [rad]."""
    arm, q = setup.arm, setup.q_start
    p_WC = np.array(setup.scenario.trocar.position_m)
    room = np.inf
    for _, p in setup.task.reach():
        for _ in range(5):
            kin = arm.kinematics(q)
            rcm = rcm_kinematics(kin, p_WC, np.zeros(3))
            miss = np.concatenate([kin.p_WT - p, rcm.error])
            q = q - np.linalg.pinv(np.vstack([kin.Jv_WT, rcm.jacobian]), rcond=1e-6) @ miss
        room = min(room, np.minimum(q - arm.limits.q_min, arm.limits.q_max - q).min())
    return room


def test_a_start_near_its_posture_whose_path_comes_to_a_limit_gives_way_to_the_roomiest(scenario):
    near = near_posture_start(scenario(*NEAR_A_LIMIT))
    given = prepare(scenario(*NEAR_A_LIMIT, f"start={{q_rad: {near.tolist()}}}"))
    assert _room(given) < 0.01, "joint 3 is at its limit on the path"
    assert _room(prepare(scenario(*NEAR_A_LIMIT))) > 0.34


def test_a_start_with_room_near_its_posture_is_taken_as_it_is(scenario):
    near = scenario("task.radius_m=0.05", "task.start_m=[0.05, 0.55, 0.02]", "task.duration_s=4")
    np.testing.assert_array_equal(prepare(near).q_start, near_posture_start(near))


def near_posture_start(scenario):
    """The start that the posture alone gives."""
    reach = Reach(ArmModel(scenario.scene), scenario.scene)
    return near_posture(reach, np.array(scenario.task.start_m), np.array(scenario.start.posture_rad))


@pytest.mark.parametrize("name", ["circle_lwr4plus", "circle_panda", "spiral_lwr4plus", "insertion_lwr4plus"])
def test_without_a_posture_the_start_has_at_least_the_room_of_the_shipped_one(name):
    shipped_one = prepare(load_scenario(name, assignments=["theatre=false"]))
    searched = prepare(load_scenario(name, assignments=["theatre=false", "start={}"]))
    _assert_starts_well(searched)
    assert _room(searched) > _room(shipped_one) - 0.01


def test_the_start_near_a_posture_is_the_one_that_mink_finds():
    scenario = load_scenario("circle_lwr4plus", assignments=["theatre=false"])
    reach = Reach(ArmModel(scenario.scene), scenario.scene)
    place, posture = np.array(scenario.task.start_m), np.array(scenario.start.posture_rad)
    found = near_posture(reach, place, posture)
    np.testing.assert_allclose(found, _by_mink(reach, place, posture), atol=1e-12)


def _by_mink(reach, place, posture):
    """Up to 200 steps of mink from the posture, each of 0.3 rad at most: the start of published results."""
    model = reach.arm.scene.model
    configuration = mink.Configuration(model)
    tip = mink.FrameTask("tip", "site", position_cost=1.0, orientation_cost=0.0)
    tip.set_target(mink.SE3.from_translation(place))
    pull = mink.PostureTask(model, cost=1e-4)
    pull.set_target(posture)
    rows = RcmTask(reach.arm.scene.tip_site, model.nv)
    rows.target = reach.p_WC
    limits = [mink.ConfigurationLimit(model, gain=0.95, min_distance_from_limits=LIMIT_MARGIN_RAD)]
    configuration.update(posture)
    for count in range(200):
        step = mink.solve_ik(
            configuration, [tip, pull], 1.0, "daqp", damping=1e-9, limits=limits, constraints=[rows]
        )
        configuration.integrate_inplace(step * min(1.0, 0.3 / np.linalg.norm(step)), 1.0)
        if count and max(reach.miss(configuration.q, place)) < 1e-9:
            break
    return configuration.q


def test_a_start_given_in_joints_is_taken_as_it_is_and_begins_the_path(scenario):
    q = prepare(scenario()).q_start
    setup = prepare(scenario(f"start.q_rad={q.tolist()}", "task.start_m=null"))
    np.testing.assert_array_equal(setup.q_start, q)
    np.testing.assert_allclose(setup.task.command(0.0).p_WTd, setup.arm.kinematics(q).p_WT, atol=1e-12)


@pytest.mark.parametrize(
    ("late", "starts"),
    [
        ("{type: push, start_s: 20.0}", "20"),
        ("{type: push, start_s: 0.3}", "0.3"),
        ("{type: guiding_hand, start_s: 0.9}", "0.4"),
    ],
)
def test_a_disturbance_that_begins_after_the_end_is_refused(scenario, late, starts):
    late = scenario(f"disturbances=[{{type: payload}}, {late}]")
    text = f"short: disturbances.1 starts at {starts} s, the run ends at 0.3 s"
    with pytest.raises(SurgsimError, match=re.escape(text.replace("short", late.name))):
        prepare(late)
    assert prepare(scenario("disturbances=[{type: push, start_s: 0.29}]"))


def test_every_disturbance_with_a_start_says_when_it_begins():
    timed = [name for name in DISTURBANCES.names() if "start_s" in DISTURBANCES.config(name).model_fields]
    assert timed == ["guiding_hand", "push"]
    for name in timed:
        assert DISTURBANCES.config(name)(start_s=7.0).begins_s > 6.0, name


SPIRAL = "task={type: spiral, start_m: [0.02, 0.55, 0.02], length_m: 0.3, turns: 1.0, normal: [0, 0, -1]}"
REFUSED = {
    "too deep": (
        ["task.start_m=[0.0, 0.55, -0.21]"],
        "circle_lwr4plus: the start at (0.000, 0.550, -0.210) m cannot be reached: "
        "it is 0.410 m from the trocar, but the shaft is 0.400 m long",
    ),
    "goes too deep": (
        [SPIRAL],
        r"/circle_lwr4plus: at t = \d\.\d\d s the path point \(.*\) m cannot be reached: "
        r"it is 0\.4\d\d m from the trocar, but the shaft is 0\.400 m long",
    ),
    "too inclined": (
        ["task.start_m=[0.2, 0.55, 0.19]", "task.radius_m=0.02"],
        "circle_lwr4plus: the start at (0.200, 0.550, 0.190) m cannot be reached: "
        "the shaft would be inclined 87 deg to the port's axis, more than 80 deg",
    ),
    "start out of joint range": (
        ["trocar.position_m=[0.0, 1.2, 0.2]", "task.start_m=[0.02, 1.2, 0.02]"],
        r"/circle_lwr4plus: the start at \(0\.020, 1\.200, 0\.020\) m cannot be reached: the best "
        r"configuration found leaves the tip \d+\.\d mm and the shaft \d+\.\d mm away \(joint \d.* limit\)",
    ),
    "path out of joint range": (
        ["task.radius_m=0.1", "task.direction=[0, -1, 0]"],
        r"/circle_lwr4plus: at t = \d\.\d\d s the path point \(.*\) m cannot be reached: "
        r"the tip stays \d+\.\d mm and the shaft \d+\.\d mm away \(joint \d.* at the position limit\)",
    ),
    "given start elsewhere": (
        [GIVEN],
        r"/circle_lwr4plus: start\.q_rad leaves the tip \d+\.\d mm from the path's start and the shaft "
        r"\d+\.\d mm from the trocar; both must be within 1 mm",
    ),
    "given start out of range": (
        [GIVEN.replace("[1.5708", "[3.5708")],
        "circle_lwr4plus: start.q_rad: joint 1 at 3.5708 rad is outside [-2.9671, 2.9671] rad",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_out_of_reach_is_refused_with_the_reason(scenario, name):
    changes, text = REFUSED[name]
    pattern = text[1:] if text.startswith("/") else re.escape(text)
    with pytest.raises(UnreachableError) as caught:
        prepare(scenario(*changes))
    assert re.fullmatch(pattern, str(caught.value)), str(caught.value)


@pytest.mark.parametrize(
    ("tip", "reason"),
    [
        ([0.0, 0.3, 0.25], "it is outside the patient, 0.050 m above the port"),
        ([0.0, 0.3, 0.2], "it is outside the patient, 0.000 m above the port"),
        ([0.0, 0.2, 0.19], "the shaft would be inclined 84 deg to the port's axis, more than 80 deg"),
        ([0.0, 0.3, -0.25], "it is 0.450 m from the trocar, but the shaft is 0.400 m long"),
    ],
)
def test_points_that_are_no_pose_through_the_port_are_refused_whatever_the_arm(tip, reason):
    trocar = TrocarConfig(position_m=(0.0, 0.3, 0.2))
    with pytest.raises(UnreachableError, match=re.escape(f"m cannot be reached: {reason}")):
        check_through_port(np.array(tip), "the start at", InstrumentConfig(), trocar)


def test_a_point_below_the_port_is_accepted():
    trocar = TrocarConfig(position_m=(0.0, 0.3, 0.2))
    check_through_port(np.array([0.0, 0.3, 0.0]), "the start at", InstrumentConfig(), trocar)


def test_a_start_above_the_port_is_refused_because_of_that(scenario):
    with pytest.raises(UnreachableError, match=r"outside the patient, 0\.050 m above the port"):
        prepare(scenario("task.start_m=[0.02, 0.55, 0.25]"))
