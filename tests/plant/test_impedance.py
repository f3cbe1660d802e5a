"""The arm's own joint impedance: against springs and oscillators on paper, and what its interface refuses."""

import mujoco
import numpy as np
import pytest
import scipy.signal

import surgsim
from surgsim.control.torque_laws.joint_reference import JointReferenceConfig
from surgsim.env.actions import with_agent
from surgsim.errors import Outcome, ScenarioError, SurgsimError
from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.models.drive import DriveConfig
from surgsim.models.robot import joint_names
from surgsim.plant.drive import JointDrives
from surgsim.plant.dynamic import DynamicPlant
from surgsim.plant.part import PlantPart
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

REAL = RobotConfig(name="fr3", drive="real").drives
POSE = np.array([0.0, -0.3, 0.2, -1.8, 0.1, 1.6, 0.3])
N, DT = POSE.size, 1e-3
STIFFNESS = (3000.0, 3000.0, 3000.0, 2500.0, 2500.0, 2000.0, 2000.0)
PANDA = (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0)
OWN = {"command": "joint_impedance", "impedance_stiffness_nm_per_rad": STIFFNESS}


class Torque(PlantPart):
    """A torque on every joint, from outside."""

    def __init__(self):
        self.nm = np.zeros(N)

    def push(self, t_s, scene, data):
        data.qfrc_applied[scene.dof_ids] += self.nm


class Undamped(PlantPart):
    """Takes the damping from the joints."""

    def modify(self, spec):
        for name in joint_names(spec):
            spec.joint(name).damping = np.zeros(3)


class Arm:
    """An FR3 under its own impedance loop."""

    def __init__(self, *, damped=True, **changes):
        config = DriveConfig(**{**OWN, "coulomb_nm": 0.0, **changes}).on(REAL)
        robot = RobotConfig(name="fr3", drive=config)
        nominal = SceneConfig(robot=robot, theatre=False, timestep_s=DT)
        self.part, self.torque = JointDrives(config, np.random.default_rng(0), nominal), Torque()
        parts = [self.torque, PlantPart() if damped else Undamped(), self.part]
        self.scene = build(nominal, parts, drawn=False)
        self.plant = DynamicPlant(self.scene, DT, parts)
        self.plant.reset(POSE)

    def go(self, q_cmd, ticks=1):
        """Where the joints are after each tick (ticks, n)."""
        return np.array(
            [self.plant.step(np.zeros(N), np.zeros(N), q_cmd=q_cmd).q.copy() for _ in range(ticks)]
        )

    @property
    def target(self):
        """Where the reference is to be (n,)."""
        names = [column for block in self.part.columns for column in block.columns]
        first = next(i for i, name in enumerate(names) if name.startswith("joint_command"))
        return self.plant.hooks.values_of(4)[first : first + N].copy()


@pytest.mark.parametrize("encoder", ["link", "motor"])
def test_a_torque_deflects_it_by_the_torque_over_its_stiffness(encoder):
    arm = Arm(encoder=encoder)
    assert np.abs(arm.go(POSE, 1500)[-1] - POSE).max() < 1e-6, "it holds itself"
    arm.torque.nm[:] = [20.0, -20.0, 10.0, 15.0, -5.0, 4.0, 2.0]
    moved = arm.go(POSE, 3000)[-1] - POSE
    assert moved == pytest.approx(arm.torque.nm / STIFFNESS, rel=0.01)


@pytest.mark.parametrize("ratio", [0.3, 0.7])
def test_a_joint_answers_as_a_damped_oscillator(ratio):
    """The first joint, the others held by endless rotors: x'' + 2 zeta w x' + w^2 x = w^2 x_d, w^2 = K/M."""
    rotors = np.array([0.6, *[1e6] * (N - 1)])
    arm = Arm(
        damped=False,
        stiffness_nm_per_rad=(1e7,) * N,
        rotor_inertia_kg_m2=tuple(rotors),
        inertia_shaping=1.0,
        loop_damping_ratio=0.1,
        loop_cutoff_hz=1e5,
        loop_delay_s=0.0,
        impedance_damping_ratio=ratio,
    )
    data = arm.plant.data
    mass = np.zeros((N, N))
    mujoco.mj_fullM(arm.scene.model, data, mass)
    w = np.sqrt(STIFFNESS[0] / (mass[0, 0] + rotors[0]))
    arm.go(POSE, 5)
    wanted = POSE + np.array([0.01, *[0.0] * (N - 1)])
    seen = arm.go(wanted, 300)[:, 0] / 0.01
    t = DT * np.arange(1, 301)
    answer = scipy.signal.lsim(
        ([w * w], [1.0, 2.0 * ratio * w, w * w]),
        U=np.minimum(np.arange(3001) / 10.0, 1.0),  # the command's way takes a period
        T=np.linspace(0.0, 0.3, 3001),
    )[1][10::10]
    assert t.size == answer.size
    assert seen == pytest.approx(answer, abs=0.01)
    over = np.exp(-np.pi * ratio / np.sqrt(1.0 - ratio * ratio))
    assert seen.max() - 1.0 == pytest.approx(over, abs=0.01)


def test_of_a_command_that_does_not_arrive_the_acceleration_goes_on():
    arm = Arm()
    path = POSE + 0.5 * np.arange(6)[:, None] ** 2 * DT * DT  # 1 rad/s^2
    for q_cmd in path[:4]:
        arm.go(q_cmd)
    for k in (4, 5):
        arm.go(np.full(N, np.inf))
        assert arm.target == pytest.approx(path[k], abs=1e-12)


def run(past, *, disturbances=(), duration_s=4.0, seed=0, **drive):
    settings = {
        "robot.drive": {**OWN, "past_joint_motion": past, **drive},
        "controller.torque_law": {"type": "joint_reference"},
        "task.duration_s": duration_s,
        "task.ramp_s": 0.5,
        "theatre": False,
        "disturbances": list(disturbances),
    }
    return Simulation(
        prepare(surgsim.load("circle_panda", controller="joint_impedance", settings=settings, seed=seed))
    ).run()


def commanded(trace):
    """Commanded positions of each tick, from what the controller decided (ticks, n)."""
    return trace.block("q_ref")[:-1] + DT * trace.block("qdot_ref")[:-1]


def accelerations(q):
    """a_k = (v_k - v_k-1) / h with v = 0 at the first command (ticks, n)."""
    v = np.vstack([np.zeros(N), np.diff(q, axis=0) / DT])
    return np.vstack([np.zeros(N), np.diff(v, axis=0) / DT])


@pytest.fixture(scope="module")
def free():
    """A run without a limit."""
    return run("ignore")


@pytest.mark.parametrize("what", ["acceleration", "jerk"])
def test_the_reflex_comes_at_the_tick_in_which_the_limit_is_passed(free, what):
    asked = np.abs(accelerations(commanded(free)))
    key = "joint_acceleration_rad_per_s2"
    if what == "jerk":
        a = accelerations(commanded(free))
        asked, key = np.abs(np.diff(a, axis=0, prepend=np.zeros((1, N)))) / DT, "joint_jerk_rad_per_s3"
    share = 0.9 * asked[5:].max(axis=0)
    share[:3] *= 10.0
    limits = tuple(np.maximum(share, asked[:5].max(axis=0) * 1.01).tolist())
    first = int(np.flatnonzero((asked > limits).any(axis=1))[0])
    trace = run("stop", **{key: limits})
    ending = trace.meta.ending
    assert ending.outcome is Outcome.ACCELERATION_DISCONTINUITY
    assert key in ending.detail
    assert first > 5
    assert ending.t_s == pytest.approx(first * DT, abs=1e-9)
    held = np.abs(trace.stop().block("v")).max(axis=1)
    assert held[-1] < 0.02, "its own stop holds it"


def test_a_clipped_command_keeps_to_the_limits(free):
    limits = tuple((0.8 * np.abs(accelerations(commanded(free))).max(axis=0)).tolist())
    trace = run("clip", joint_acceleration_rad_per_s2=limits)
    found = np.abs(accelerations(trace.active().block("joint_command")[1:]))
    assert found.shape[0] > 1000
    assert (found <= np.array(limits) * (1.0 + 1e-6)).all()
    assert (found > np.array(limits) * 0.999).any()


def test_a_limit_that_is_not_passed_changes_no_bit(free):
    for past in ("clip", "stop"):
        calm = run(past, joint_acceleration_rad_per_s2=PANDA)
        assert np.array_equal(calm.block("q"), free.block("q"))
    assert np.abs(free.block("joint_command")[1:] - commanded(free)).max() < 1e-15


def lost(seed, probability, burst, ticks):
    """Ticks in a row that are lost up to each tick, drawn as the scenario's seed says."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,)).spawn(1)[0])
    row, left = [0], 0
    for _ in range(1, ticks):
        if left == 0 and rng.random() < probability:
            left = int(rng.integers(1, burst + 1))
        row.append(row[-1] + 1 if left else 0)
        left = max(left - 1, 0)
    return np.array(row)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_as_many_lost_in_a_row_as_stated_end_the_run(seed):
    late = {"type": "late_ticks", "probability": 0.02, "burst_ticks": 8, "stop_after_ticks": 7}
    trace = run("ignore", disturbances=[late], seed=seed)
    expected = lost(seed, 0.02, 8, 3000)
    last = int(np.flatnonzero(expected == 7)[0])
    assert trace.meta.ending.outcome is Outcome.COMMUNICATION_CONSTRAINTS_VIOLATION
    assert trace.meta.ending.t_s == pytest.approx(last * DT, abs=1e-9)
    counts = trace["lost_ticks"][1 : last + 1]  # a row's is that of the tick before it
    assert np.array_equal(counts, expected[:last])
    assert np.abs(trace.stop().block("v")).max(axis=1)[-1] < 0.02


def test_a_delayed_reference_is_the_same_later(free):
    late = run("ignore", disturbances=[{"type": "actuation_delay", "delay_s": 0.005}])
    assert np.array_equal(late.block("joint_command")[7:], free.block("joint_command")[2:-5])


def test_a_run_goes_on_from_a_snapshot_with_the_same_bits():
    settings = {"robot.drive": OWN, "controller.torque_law": {"type": "joint_reference"}, "theatre": False}
    settings |= {"task.duration_s": 0.3, "task.ramp_s": 0.1}
    scenario = surgsim.load("circle_panda", controller="joint_impedance", settings=settings)
    first, other = Simulation(prepare(scenario)), Simulation(prepare(scenario))
    first.advance(150)
    other.restore(first.snapshot())
    assert first.run().equals(other.run())


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"robot.drive": {"command": "joint_impedance"}},
            "controller.torque_law must be one that commands them",
        ),
        ({"controller.torque_law": {"type": "joint_reference"}}, "needs robot.drive.command joint_impedance"),
        ({"robot.drive": {"joint_jerk_rad_per_s3": 5000.0}}, "it needs command joint_impedance"),
        ({"robot.drive": {**OWN, "impedance_damping_ratio": (0.7, 0.7)}}, "2 items for an arm of 7 joints"),
    ],
    ids=["law of torques", "arm of torques", "limit of torques", "two ratios"],
)
def test_what_does_not_fit_is_refused(changes, said):
    with pytest.raises(ScenarioError, match=said):
        surgsim.load("circle_panda", controller="joint_impedance", settings=changes)


def test_an_agent_commands_joint_velocities_through_it_and_no_torques():
    settings = {"robot.drive": OWN, "controller.torque_law": {"type": "joint_reference"}}
    scenario = surgsim.load("circle_panda", controller="joint_impedance", settings=settings)
    told = with_agent(scenario, "joint_velocity", None, 1)
    assert isinstance(told.controller.torque_law, JointReferenceConfig)
    with pytest.raises(SurgsimError, match="joint_impedance takes no torque"):
        with_agent(scenario, "torque", None, 1)
