"""The drives of the joints: against vibration theory, MuJoCo's own joints and springs, and their account."""

import mujoco
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
import scipy.signal

import surgsim
from surgsim.errors import Outcome
from surgsim.models import build as building
from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.models.drive import DriveConfig
from surgsim.models.robot import joint_names
from surgsim.plant.drive import ACCOUNT_SIZE, COMMAND, LOOP_S, JointDrives
from surgsim.plant.dynamic import DynamicPlant
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

REAL = RobotConfig(name="fr3", drive="real").drives
K, B = np.array(REAL.stiffness_nm_per_rad), np.array(REAL.rotor_inertia_kg_m2)
POSE = np.array([0.0, -0.3, 0.2, -1.8, 0.1, 1.6, 0.3])
N = POSE.size
BARE = {"inertia_shaping": 1.0, "loop_damping_ratio": 0.0, "loop_cutoff_hz": 1e5, "coulomb_nm": 0.0}


def drives(**changes):
    """The FR3's drives with changes."""
    return DriveConfig(**changes).on(REAL)


class Alone:
    """An arm on drives, without weight or damping unless `heavy`."""

    def __init__(self, config, timestep_s=0.001, *, heavy=False):
        self.part = JointDrives(config, np.random.default_rng(0))
        scene = SceneConfig(robot=RobotConfig(name="fr3"), theatre=False, timestep_s=timestep_s)
        if not heavy:
            self.scene = build(scene, [Undamped(), self.part], drawn=False)
            self.scene.model.opt.gravity[:] = 0.0
        else:
            self.scene = build(scene, [self.part], drawn=False)
        self.plant = DynamicPlant(self.scene, 0.001, [self.part])
        self.plant.reset(POSE)
        self.memory = self.plant.hooks.memory_of(2)

    @property
    def motors(self):
        """Positions of the motors (n,) [rad], to be changed."""
        return self.memory[ACCOUNT_SIZE : ACCOUNT_SIZE + N]

    def column(self, name):
        """Values of a column of the drives."""
        names = [column for block in self.part.columns for column in block.columns]
        values = self.plant.hooks.values_of(2)
        return np.array([values[i] for i, known in enumerate(names) if known.startswith(name)])


class Undamped:
    """Takes the damping from the joints."""

    def modify(self, spec):
        for name in joint_names(spec):
            spec.joint(name).damping = np.zeros(3)


def links_inertia(scene):
    data, M = mujoco.MjData(scene.model), np.zeros((N, N))
    data.qpos[:N] = POSE
    mujoco.mj_forward(scene.model, data)
    mujoco.mj_fullM(scene.model, data, M)
    return M


@pytest.mark.parametrize("timestep_s", [1e-3, 1e-4])
@pytest.mark.parametrize("held", [False, True], ids=["free", "motors held"])
def test_it_vibrates_at_the_resonances_of_links_and_motors(timestep_s, held):
    """Resonances, and with motors that nothing moves antiresonances, are those of M, B and K within 1 %."""
    rotors = B * (1e7 if held else 1.0)
    arm = Alone(drives(rotor_inertia_kg_m2=tuple(rotors), **BARE), timestep_s)
    mass = scipy.linalg.block_diag(links_inertia(arm.scene), np.diag(rotors))
    stiffness = np.block([[np.diag(K), -np.diag(K)], [-np.diag(K), np.diag(K)]])
    squares, modes = scipy.linalg.eigh(stiffness, mass)
    for w, mode in zip(np.sqrt(squares[N:]), modes.T[N:], strict=True):
        if w * LOOP_S > 0.3:  # the trapezoidal rule is low by (w h)^2/12: only the roll of a straight tool
            assert w > 2000.0
            continue
        arm.plant.reset(POSE)
        x = mode * 1e-6 / np.abs(mode).max()
        arm.plant.data.qpos[:N] += x[:N]
        arm.motors[:] += x[N:]
        arm.plant.see()
        seen = []
        for _ in range(300):
            arm.plant.step(np.zeros(N), np.zeros(N))
            seen.append(mode @ mass @ np.concatenate([arm.plant.data.qpos[:N] - POSE, arm.motors - POSE]))
        t, seen = 1e-3 * np.arange(1, 301), np.array(seen) / (mode @ mass @ x)
        fit = scipy.optimize.least_squares(
            lambda p, t=t, seen=seen: np.exp(-p[1] * t) * np.cos(p[0] * t + p[2]) - seen, [w, 0.0, 0.0]
        )
        assert fit.cost < 1e-6
        assert fit.x[0] == pytest.approx(w, rel=0.01)
        assert abs(fit.x[1]) < 0.001 * w


def two_hinges(config):
    """The same arm of MuJoCo's own parts: each joint is two about one axis, with armature and spring."""

    class Rotors:
        def modify(self, spec):
            values = config.values(N)
            for i, name in enumerate(joint_names(spec)):
                link = spec.joint(name)
                body = link.parent
                body.add_joint(
                    name=f"gear{i}",
                    type=mujoco.mjtJoint.mjJNT_HINGE,
                    axis=link.axis,
                    pos=link.pos,
                    stiffness=np.array([values.stiffness[i], 0.0, 0.0]),
                    damping=np.array([values.gear_damping[i], 0.0, 0.0]),
                    limited=mujoco.mjtLimited.mjLIMITED_FALSE,
                    armature=0.0,
                    frictionloss=0.0,
                )
                link.armature, link.damping = values.rotor_inertia[i], np.zeros(3)
                link.limited = mujoco.mjtLimited.mjLIMITED_FALSE

    scene = SceneConfig(robot=RobotConfig(name="fr3"), theatre=False, timestep_s=1e-5)
    spec = mujoco.MjSpec()
    spec.compiler.discardvisual = True
    building._add_arm(spec, scene)
    Rotors().modify(spec)
    return spec.compile()


def test_it_moves_as_joints_and_springs_of_mujoco():
    """Two hinges a joint, stepped a hundred times as often, agree within 2 % in links and torques."""
    config = drives(
        gear_damping_nm_s_per_rad=5.0,
        inertia_shaping=4.0,
        loop_delay_s=0.0,
        loop_cutoff_hz=1e5,
        coulomb_nm=0.0,
    )
    values = config.values(N)
    arm = Alone(config)
    arm.scene.model.opt.gravity[:] = 0.0
    arm.plant.reset(POSE)
    model = two_hinges(config)
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    rotor, gear = np.arange(0, 2 * N, 2), np.arange(1, 2 * N, 2)
    data.qpos[rotor] = POSE
    ours, theirs = [], []
    ratio, per_loop = config.inertia_shaping, round(LOOP_S / model.opt.timestep)
    for tick in range(200):
        t = 1e-3 * tick
        u = np.array([6.0, 8.0, 5.0, 4.0, 1.0, 1.0, 0.1]) * np.sin(2.0 * np.pi * np.linspace(3.0, 9.0, N) * t)
        arm.plant.step(u, np.zeros(N))
        for k in range(100):
            if k % per_loop == 0:
                spring = -K * data.qpos[gear] - values.gear_damping * data.qvel[gear]
                motor = ratio * (u + values.loop_damping * data.qvel[gear]) + (1.0 - ratio) * spring
            data.qfrc_applied[rotor] = motor
            mujoco.mj_step(model, data)
        ours.append(np.concatenate([arm.plant.data.qpos[:N] - POSE, arm.column("joint_torque")]))
        spring = -K * data.qpos[gear] - values.gear_damping * data.qvel[gear]
        theirs.append(np.concatenate([data.qpos[rotor] + data.qpos[gear] - POSE, spring]))
    ours, theirs = np.array(ours), np.array(theirs)
    way = np.ptp(theirs, axis=0)
    assert way[: N - 1].min() > 1e-3, "the arm hardly moved"
    assert np.abs(ours - theirs)[:, : N - 1].max(axis=0) / way[: N - 1] == pytest.approx(0.0, abs=0.02)
    assert np.abs(ours - theirs)[:, N:].max(axis=0) / way[N:] == pytest.approx(0.0, abs=0.02)


def run(robot="panda", controller="rcm_elastic_dynamics", duration_s=1.0, drive=None, **blocks):
    settings = {"robot.drive": drive or "real", "task.duration_s": duration_s, "task.ramp_s": 0.1}
    scenario = surgsim.load(f"circle_{robot}", controller=controller, settings=settings, **blocks)
    return Simulation(prepare(scenario)).run()


def test_the_step_hardly_matters():
    """A tenth of the physics step changes positions and torques by less than 2 %."""
    coarse = run()
    fine = run(simulation={"timestep_s": 1e-4, "control_period_s": 1e-3})
    for name in ("q", "joint_torque"):
        a, b = coarse.block(name), fine.block(name)
        assert np.abs(a - b).max() < 0.02 * np.ptp(b, axis=0).max()


def test_its_account_of_energy_is_closed():
    trace = run(duration_s=2.0)
    work, loss, stored, given = (trace[f"drive_{name}_j"] for name in ("work", "loss", "stored", "given"))
    assert np.all(np.diff(loss) > -1e-12)
    assert loss[-1] > 0.1
    assert np.abs(work - loss - stored - given).max() < 1e-3 * loss[-1]


def test_without_a_motor_torque_energy_only_falls():
    arm = Alone(drives(gear_damping_nm_s_per_rad=2.0, **{**BARE, "coulomb_nm": 0.2}))
    arm.motors[:] += 1e-3 * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 0.0])
    M, totals = links_inertia(arm.scene), []
    for _ in range(300):
        arm.plant.step(np.zeros(N), np.zeros(N))
        v = arm.plant.data.qvel[:N]
        totals.append(arm.column("drive_stored_j")[0] + 0.5 * v @ M @ v)
    totals = np.array(totals)
    assert totals[0] > 1e-3
    assert np.all(np.diff(totals) < 1e-6 * totals[0])
    assert totals[-1] < 0.5 * totals[0]


def test_dry_friction_holds_a_motor_that_it_can_hold():
    """Below the friction nothing moves at all; above it the loss is friction times way."""
    arm = Alone(drives(**{**BARE, "coulomb_nm": 2.0}))
    push = np.zeros(N)
    push[0] = 1.9
    for _ in range(200):
        arm.plant.step(push, np.zeros(N))
    assert np.array_equal(arm.plant.data.qpos[:N], POSE)
    assert not np.any(arm.column("motor_speed"))
    push[0] = 4.0
    for _ in range(200):
        arm.plant.step(push, np.zeros(N))
    way = arm.motors[0] - POSE[0]
    assert way > 1e-3
    assert arm.column("drive_loss_j")[0] == pytest.approx(2.0 * way, rel=0.02)


def test_a_light_link_sticks_and_slips_as_with_a_fine_step():
    """MuJoCo's own friction, found once a millisecond, threw the wrist about until the run ended."""
    friction = [{"type": "joint_friction", "coulomb_nm": 0.5}]
    coarse = run("lwr4plus", disturbances=friction)
    fine = run("lwr4plus", disturbances=friction, simulation={"timestep_s": 1e-4, "control_period_s": 1e-3})
    assert coarse.meta.ending.outcome is Outcome.COMPLETED
    for name in ("q", "joint_torque"):
        a, b = coarse.block(name), fine.block(name)
        assert np.abs(a - b).max() < 0.01 * np.ptp(b, axis=0).max()
    rest = np.abs(coarse.block("v")) < 1e-9
    assert 0.05 < rest.mean() < 0.95


def test_a_link_is_held_that_its_friction_can_hold():
    """Below it the gear winds up and the link does not move; above it the link goes."""
    config = drives(**{**BARE, "gear_damping_nm_s_per_rad": 5.0})

    class Dry:
        def modify(self, spec):
            spec.joint(joint_names(spec)[1]).frictionloss = 3.0

    part = JointDrives(config, np.random.default_rng(0))
    scene = SceneConfig(robot=RobotConfig(name="fr3"), theatre=False, timestep_s=1e-3)
    built = build(scene, [Undamped(), Dry(), part], drawn=False)
    built.model.opt.gravity[:] = 0.0
    assert not built.model.dof_frictionloss.any()
    plant, push = DynamicPlant(built, 0.001, [part]), np.zeros(N)
    plant.reset(POSE)
    for torque, moves in ((1.4, False), (4.5, True)):  # the gear swings to twice the torque
        push[1] = torque
        before = plant.data.qpos[1]
        for _ in range(300):
            plant.step(push, np.zeros(N))
        moved = plant.data.qpos[1] - before
        assert moved > 1e-3 if moves else abs(moved) < 1e-12
        values = plant.hooks.values_of(2)
        names = [column for block in part.columns for column in block.columns]
        lost = values[names.index("drive_link_friction_j")]
        assert lost == pytest.approx(3.0 * moved, rel=1e-3, abs=1e-12)


def test_friction_that_is_greater_at_rest_belongs_to_the_motors():
    friction = [{"type": "joint_friction", "coulomb_nm": 0.5, "static_nm": 0.8}]
    with pytest.raises(surgsim.SurgsimError, match=r"give robot\.drive\.static_nm"):
        run(disturbances=friction)


def test_the_torque_loop_divides_inertia():
    """On held links the gears' torques answer a step as K / (B_s s^2 + D_s s + K) does, B_s = B / 4."""
    arm = Alone(drives(inertia_shaping=4.0, loop_cutoff_hz=1e5, loop_delay_s=0.0, coulomb_nm=0.0))
    model = arm.scene.model
    model.body_inertia[:] *= 1e6
    model.body_mass[:] *= 1e6
    arm.plant.reset(POSE)
    seen = []
    for _ in range(60):
        arm.plant.step(np.full(N, 1.0), np.zeros(N))
        seen.append(arm.column("joint_torque"))
    t = 1e-3 * np.arange(1, 61)
    for i in range(N - 1):
        answer = scipy.signal.step(
            ([K[i]], [B[i] / 4.0, np.sqrt(K[i] * B[i] / 4.0), K[i]]), T=np.append(0.0, t)
        )
        assert np.array(seen)[:, i] == pytest.approx(answer[1][1:], abs=0.02)


def test_a_torque_that_changes_too_fast_can_end_the_run():
    """As an arm's reflex does; `ignore` is as if no limit were stated."""
    slow = {"torque_rate_nm_per_s": 20.0, "past_torque_rate": "stop", "coulomb_nm": 0.0}
    ending = run(controller="joint_impedance", duration_s=0.3, drive=slow).meta.ending
    assert ending.outcome is Outcome.TORQUE_RATE_LIMIT
    assert "torque_rate_nm_per_s" in ending.detail
    traces = [
        run(controller="joint_impedance", duration_s=0.3, drive={**slow, **changes})
        for changes in ({"past_torque_rate": "ignore"}, {"torque_rate_nm_per_s": None})
    ]
    assert np.array_equal(traces[0].block("q"), traces[1].block("q"))


def test_the_interface_clips_and_smooths():
    arm = Alone(drives(torque_rate_nm_per_s=100.0, command_cutoff_hz=None, **BARE))
    rows = arm.memory[ACCOUNT_SIZE:].reshape(-1)
    acting = rows[COMMAND * N : COMMAND * N + N]
    arm.plant.step(np.zeros(N), np.zeros(N))  # where it begins
    arm.plant.step(np.full(N, 5.0), np.zeros(N))
    assert acting == pytest.approx(0.1)
    smooth = Alone(drives(torque_rate_nm_per_s=None, command_cutoff_hz=50.0, **BARE))
    acting = smooth.memory[ACCOUNT_SIZE + COMMAND * N : ACCOUNT_SIZE + COMMAND * N + N]
    smooth.plant.step(np.zeros(N), np.zeros(N))
    for k in range(1, 6):
        smooth.plant.step(np.full(N, 1.0), np.zeros(N))
        assert acting == pytest.approx(1.0 - np.exp(-2.0 * np.pi * 50.0 * 1e-3 * k))


def test_encoders_sit_where_they_are_said_to():
    for side in ("link", "motor"):
        arm = Alone(drives(encoder=side, **BARE), heavy=True)
        measured = arm.plant.state()
        assert measured.q == pytest.approx(POSE, abs=1e-12)  # the gears' deflection is known from the torques
        assert np.abs(arm.motors - POSE).max() > 1e-3
        for _ in range(30):
            arm.plant.step(np.full(N, 5.0), np.zeros(N))
        truth, measured = arm.plant.truth(), arm.plant.state()
        speed = truth.v if side == "link" else arm.column("motor_speed")
        assert measured.v == pytest.approx(speed, abs=1e-12)
    assert np.abs(truth.v - arm.column("motor_speed")).max() > 1e-3


def test_a_biased_torque_sensor_is_seen_and_acts_on_the_loop():
    """A loop with B/B_s = 4 takes a bias b for a torque in the gear, which moves by -(1 - B_s/B) b."""
    plain = Alone(drives(sensor_bias_nm=0.0, coulomb_nm=0.0), heavy=True)
    held = plain.plant.state().tau.copy()
    biased = Alone(drives(sensor_bias_nm=0.4, coulomb_nm=0.0), heavy=True)
    first = biased.plant.state().tau - held
    assert np.abs(first) == pytest.approx(0.4)
    biased.scene.model.body_inertia[:] *= 1e6
    biased.scene.model.body_mass[:] *= 1e6
    biased.scene.model.opt.gravity[:] = 0.0
    biased.plant.reset(POSE)
    for _ in range(200):
        biased.plant.step(np.zeros(N), np.zeros(N))
    moved = biased.column("joint_torque")
    assert moved[: N - 1] == pytest.approx(-0.75 * first[: N - 1], abs=0.02)


@pytest.mark.parametrize(
    ("keys", "lost"),
    [
        ({"coulomb_nm": 1.0, "static_nm": 3.0, "stribeck_velocity_rad_per_s": 0.2}, "stribeck"),
        ({"coulomb_nm": 0.0, "viscous_nm_s_per_rad": 5.0}, "viscous"),
    ],
    ids=["stribeck", "viscous"],
)
def test_friction_takes_what_its_law_says(keys, lost):
    """Loss = the integral of the friction's law over the motor's way, from the recorded speeds."""
    arm = Alone(drives(**{**BARE, **keys}))
    push, energy, loss = np.zeros(N), 0.0, []
    push[0] = 8.0
    for _ in range(300):
        arm.plant.step(push, np.zeros(N))
        w = arm.column("motor_speed")
        law = {
            "stribeck": 1.0 * np.abs(w) + 2.0 * np.exp(-((w / 0.2) ** 2)) * np.abs(w),
            "viscous": 5.0 * w * w,
        }[lost]
        energy += 1e-3 * law.sum()
        loss.append(arm.column("drive_loss_j")[0])
    assert loss[-1] > 0.02
    assert energy == pytest.approx(loss[-1], rel=0.03)


def test_ripple_is_a_wave_over_the_motor_s_turn():
    """A motor that is turned slowly is pushed back and forth by A sin(m theta), and the gear shows it."""
    arm = Alone(drives(**{**BARE, "ripple_nm": 1.5, "ripple_per_turn": 3000}))
    arm.scene.model.body_inertia[:] *= 1e6
    arm.scene.model.body_mass[:] *= 1e6
    arm.plant.reset(POSE)
    expected, seen = [], []
    for k in range(400):
        arm.plant.step(np.full(N, 20.0 * (1.0 - np.cos(0.005 * k))), np.zeros(N))
        push = 20.0 * (1.0 - np.cos(0.005 * k))
        expected.append(push - 1.5 * np.sin(3000.0 * arm.motors[0]))
        seen.append(arm.column("joint_torque")[0])
    assert np.abs(np.array(seen) - expected).mean() < 0.2
    assert np.abs(np.array(seen) - [20.0 * (1.0 - np.cos(0.005 * k)) for k in range(400)]).mean() > 0.5


def test_a_friction_observer_in_the_torque_loop_gives_friction_back():
    """Behind it a constant push turns the motor as if the friction were not there."""
    ways = []
    for coulomb, observer in ((2.0, 0.0), (2.0, 100.0), (0.0, 0.0)):
        arm = Alone(drives(**{**BARE, "coulomb_nm": coulomb, "friction_observer_hz": observer}))
        push = np.zeros(N)
        push[0] = 4.0
        for _ in range(200):
            arm.plant.step(push, np.zeros(N))
        ways.append(arm.motors[0] - POSE[0])
    assert ways[0] < 0.6 * ways[2]
    assert ways[1] == pytest.approx(ways[2], rel=0.1)


def test_the_torque_loop_s_delay_is_as_long_as_it_says():
    """Of a loop that divides by four, the first answer to a torque in the gear comes that much later."""
    seen = {}
    for delay in (0.0, 0.001, 0.002):
        arm = Alone(drives(loop_cutoff_hz=1e5, loop_delay_s=delay, loop_damping_ratio=0.0, coulomb_nm=0.0))
        arm.motors[0] += 1e-4  # 1 N m in the gear, all at once
        torques = []
        for _ in range(6):
            arm.plant.step(np.zeros(N), np.zeros(N))
            torques.append(arm.column("motor_speed")[0])
        seen[delay] = np.array(torques)
    early, middle, late = seen[0.0], seen[0.001], seen[0.002]
    assert middle[0] == pytest.approx(late[0], rel=1e-9)  # neither has answered in the first millisecond
    assert abs(early[0]) > 2.0 * abs(middle[0])
    assert abs(middle[1]) > 1.2 * abs(late[1])


def test_it_starts_at_rest():
    """Held by the torques that its weight needs the arm stays where it is."""
    arm = Alone(drives(coulomb_nm=0.0), heavy=True)
    held = arm.plant.state().tau
    for _ in range(50):
        arm.plant.step(held, np.zeros(N))
    assert arm.plant.data.qpos[:N] == pytest.approx(POSE, abs=1e-7)


def test_the_same_seed_draws_the_same():
    def gains(seed):
        part = JointDrives(
            drives(friction_spread=0.2, coulomb_nm=1.0, sensor_bias_nm=0.3), np.random.default_rng(seed)
        )
        scene = build(SceneConfig(robot=RobotConfig(name="fr3"), theatre=False), [part], drawn=False)
        part.attach(scene, 0.001)
        return part.gains.copy()

    assert np.array_equal(gains(1), gains(1))
    assert not np.array_equal(gains(1), gains(2))


def test_a_run_on_real_drives_can_be_forked():
    settings = {"robot.drive": "real", "task.duration_s": 1.0, "task.ramp_s": 0.2}
    scenario = surgsim.load("circle_panda", controller="rcm_elastic_dynamics", settings=settings)
    one = Simulation(prepare(scenario))
    one.advance(123)
    other = one.fork()
    for simulation in (one, other):
        simulation.advance(200)
    assert np.array_equal(one.trace().block("q"), other.trace().block("q"))
    assert np.array_equal(one.trace()["drive_loss_j"], other.trace()["drive_loss_j"])
