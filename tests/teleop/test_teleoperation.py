"""The whole loop without an arm: stability in contact, tanks, and what happens without them."""

import numpy as np
import pytest

from surgsim.errors import Outcome
from surgsim.metrics.catalog import METRICS
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare
from surgsim.teleop.channel import ChannelConfig
from surgsim.teleop.hand import HandCommand
from surgsim.teleop.operator import OperatorConfig
from surgsim.teleop.tank import TankConfig
from surgsim.teleop.teleoperator import COLUMNS

BAD = ChannelConfig(jitter_s=0.005, loss=0.1, duplicate=0.05)
LIGHT_GRIP = OperatorConfig(stiffness_n_per_m=20.0, damping_ns_per_m=1.0)
PUSH = {"push": True, "dwell_s": 3.0}


def tanks_hold(run):
    assert run["tank_operator_j"].min() > 0.0
    assert run["tank_remote_j"].min() > 0.0
    assert run["tank_operator_deficit_j"][-1] == run["tank_remote_deficit_j"][-1] == 0.0
    assert np.abs(run["tank_account_residual_j"]).max() < 1e-10
    assert run["delivered_j"].max() <= 2.0 * TankConfig().initial_j


@pytest.mark.parametrize("channel", [ChannelConfig(), BAD], ids=["delay", "bad"])
def test_free_motion_reaches_its_goals_with_full_tanks(teleoperate, goal, channel):
    goals = (goal(0.04, 0.0, 0.0), goal(0.0, 0.03, 0.02), goal(0.0, 0.0, 0.0, jaw=1.0))
    run = teleoperate(goals, channel=channel)
    assert run["done"][-1]
    assert run["goals_missed"][-1] == 0
    assert run["jaw"][-1] == pytest.approx(1.0)
    tip = np.array([run["x_m"][-1], run["y_m"][-1], run["z_m"][-1]])
    assert np.linalg.norm(tip) < 0.003
    tanks_hold(run)


@pytest.mark.parametrize("mode", ["power", "cumulative"])
def test_contact_with_a_stiff_wall_is_stable_and_the_tanks_hold(teleoperate, goal, point_mass, mode):
    channel = BAD.model_copy(update={"energy": mode})
    run = teleoperate(
        (goal(0.04, 0.0, 0.0, **PUSH), goal(0.0, 0.0, 0.0)), channel=channel, mass=point_mass(wall_m=0.02)
    )
    pushing = np.flatnonzero((run["force_n"] > 0.0) & (run["goal"] == 0))
    settled = pushing[-1000:]
    assert run["done"][-1]
    assert np.all(np.diff(pushing) == 1), "the contact was lost while the operator pushed"
    assert run["force_n"][settled].mean() > 1.0
    assert run["force_n"][settled].std() < 0.1 * run["force_n"][settled].mean()
    assert run["lost_packets"][-1] > 1000
    assert (run["lost_j"][-1] == 0.0) == (mode == "cumulative")
    tanks_hold(run)


def test_without_tanks_a_light_grip_lets_the_delayed_spring_feed_energy_out(teleoperate, goal):
    """K_v (x(t - 2 delta) - x(t)) drives motions between 1/(4 delta) and 1/(2 delta): 1.7 to 3.3 Hz."""
    goals = (goal(0.04, 0.0, 0.0, timeout_s=8.0),)
    runs = {
        mode: teleoperate(goals, passivity=mode, operator=LIGHT_GRIP, duration_s=9.0)
        for mode in ("off", "tank", "tdpa")
    }
    speed = {mode: np.abs(run["handle_velocity_x_m_per_s"][-2000:]).max() for mode, run in runs.items()}
    assert runs["off"]["delivered_j"][-1] > 1.0
    assert speed["off"] > 0.3
    assert runs["tank"]["delivered_j"].max() <= TankConfig().initial_j
    assert runs["tank"]["tank_operator_j"].min() < 0.5 * TankConfig().initial_j
    assert speed["tank"] < 0.2 * speed["off"]
    assert runs["tdpa"]["delivered_j"].max() < 1e-3
    tanks_hold(runs["tank"])


@pytest.mark.parametrize("grip", [(135.0, 6.45), (20.0, 1.0)], ids=["normal", "light"])
def test_the_passivity_controller_rests_on_a_wall_and_gives_no_energy(grip):
    """On the whole arm; it was said to chatter, on a wall that made energy."""
    stiffness, damping = (
        f"task.operator.{key}={value}"
        for key, value in zip(("stiffness_n_per_m", "damping_ns_per_m"), grip, strict=True)
    )
    goals = "[{position_m: [0.0, 0.65, -0.075], push: true, dwell_s: 2.0}, {position_m: [0.0, 0.65, -0.04]}]"
    assignments = (f"task.goals={goals}", "task.bilateral.passivity=tdpa", stiffness, damping)
    scenario = load_scenario("teleop_wall_panda", controller="passive_convex", assignments=assignments)
    run = Simulation(prepare(scenario)).run()
    force = run["tip_force_z_n"][run["goal"] == 0][-700:]
    assert force.min() > 1.0
    assert np.abs(np.diff(force)).max() < 0.2  # no chatter: what it holds bleeds off slowly
    assert run["delivered_j"].max() < 1e-3
    assert run["observer_remote_j"].min() > -1e-3
    assert run["operator_done"][-1]
    assert np.linalg.norm(run.block("tip")[-1] - run.block("tip_ref")[-1]) < 1e-3


def test_drift_that_the_passivity_controller_leaves_is_compensated(teleoperate, goal, point_mass):
    left = {}
    for gain in (0.0, 2.0):
        goals = (goal(0.04, 0.0, 0.0, **PUSH), goal(0.0, 0.0, 0.0, timeout_s=2.0, dwell_s=5.0))
        keys = {"passivity": "tdpa", "drift_gain_per_s": gain, "hold_end_s": 2.0}
        run = teleoperate(goals, mass=point_mass(wall_m=0.02), **keys)
        master = 0.5 * (run["handle_x_m"] - run["handle_x_m"][0])
        left[gain] = abs(run["x_m"][-1] - master[-1])
    assert left[0.0] > 5e-3
    assert left[2.0] < 0.2 * left[0.0]


@pytest.mark.parametrize("stiffness", [200.0, 1000.0])
def test_the_tank_holds_at_any_gain(teleoperate, goal, point_mass, stiffness):
    run = teleoperate(
        (goal(0.04, 0.0, 0.0, **PUSH),),
        operator=LIGHT_GRIP,
        stiffness_n_per_m=stiffness,
        channel=BAD,
        mass=point_mass(wall_m=0.02),
        duration_s=8.0,
    )
    assert run["force_scale"].min() < 1.0
    assert run["tank_operator_j"].min() > 0.5 * TankConfig().floor_j
    tanks_hold(run)


def test_an_empty_remote_tank_stops_the_push(teleoperate, goal, point_mass):
    """With nothing from the operator's tank the wall gets what is in the remote one, however far the push."""
    stored = {}
    for name, level in (("small", 0.02), ("large", TankConfig().initial_j)):

        def poor(law, level=level):
            law.operator.tank.send_limit_w = 0.0
            law.remote.tank.initial_j = law.remote.tank.target_j = level

        run = teleoperate(
            (goal(0.05, 0.0, 0.0, **PUSH),),
            drift_speed_m_per_s=0.1,
            change=poor,
            mass=point_mass(wall_m=0.02),
            duration_s=6.0,
        )
        stored[name] = 0.5 * run["force_n"].max() ** 2 / 20e3
        assert run["tank_remote_j"].min() > 0.0
        assert run["tank_remote_deficit_j"][-1] == 0.0
    assert stored["large"] > 0.02
    assert stored["small"] < 0.012


def test_a_dead_link_stops_the_remote(teleoperate, goal):
    run = teleoperate(
        (goal(0.05, 0.0, 0.0),),
        channel=ChannelConfig(loss=0.99, burst_packets=2000.0),
        duration_s=3.0,
        seed=4,
    )
    silent = run["setpoint_trust"] == 0.0
    speed = np.linalg.norm([run[f"velocity_command_{axis}_m_per_s"] for axis in "xyz"], axis=0)
    assert silent.mean() > 0.3
    assert speed[silent].max() == 0.0


def test_runs_are_deterministic(teleoperate, goal):
    runs = [teleoperate((goal(0.02, 0.0, 0.0),), channel=BAD, seed=s, duration_s=1.0) for s in (3, 3, 4)]
    for name in runs[0]:
        assert np.array_equal(runs[0][name], runs[1][name], equal_nan=True)
    assert not np.array_equal(runs[0]["handle_x_m"], runs[2]["handle_x_m"])


def test_signals_are_named_once_and_complete(teleoperate, goal):
    run = teleoperate((goal(0.02, 0.0, 0.0),), duration_s=0.01)
    names = [name for block in COLUMNS for name in block.columns]
    assert len(set(names)) == len(names)
    assert all(np.isfinite(run[name]).all() for name in set(names) - {"setpoint_age_s"})


DISTURBED = ("disturbances=[{type: sensor_noise}, {type: actuation_delay, delay_s: 0.005}]",)


@pytest.mark.parametrize(
    ("controller", "disturbed"),
    [("passive_convex", ()), ("passive_kinetic", ()), ("passive_kinetic", DISTURBED)],
    ids=["row", "valve", "valve with noise and 5 ms more delay"],
)
def test_a_small_tank_covers_a_fast_impact_with_the_valve_and_not_without(controller, disturbed):
    assignments = (
        *disturbed,
        "task.bilateral.tanks={initial_j: 0.012, target_j: 0.012}",
        "task.goals=[{position_m: [0.0, 0.65, -0.12], push: true, dwell_s: 0.5}]",
        "task.operator={stiffness_n_per_m: 1000.0, damping_ns_per_m: 20.0, reach: "
        "{speed_limit_m_per_s: 0.5, fitts_a_s: 0.0, fitts_b_s: 0.01, shortest_s: 0.1}}",
        "task.mapping.scale=1.0",
        "task.hold_end_s=0.2",
        "props.0.point_m=[0.0, 0.65, -0.05]",
    )
    scenario = load_scenario("teleop_wall_panda", controller=controller, assignments=assignments)
    trace = Simulation(prepare(scenario)).run()
    assert trace["tip_force_z_n"].max() > 10.0
    found = {name: METRICS[name].compute(trace) for name in ("tank_deficit_j", "acceleration_limit_ratio")}
    if controller == "passive_kinetic":
        assert found["tank_deficit_j"] == 0.0
        assert found["acceleration_limit_ratio"] <= 1.0 + 1e-6
        assert trace["tank_remote_j"].min() > (0.009 if disturbed else 0.0099)
        assert trace["qp_relaxed"].sum() == 0.0
    else:
        assert found["tank_deficit_j"] > 1e-3
        assert found["acceleration_limit_ratio"] > 2.0


def test_a_sideways_press_neither_saturates_a_joint_nor_runs_into_its_limit():
    goal = "[{position_m: [0.05, 0.65, -0.03], push: true, dwell_s: 4.0}]"
    wall = ("props.0.normal=[-1.0, 0.0, 0.0]", "props.0.point_m=[0.01, 0.65, -0.06]", f"task.goals={goal}")
    ends = {}
    for controller in ("passive_convex", "passive_kinetic"):
        scenario = load_scenario("teleop_wall_panda", controller=controller, assignments=wall)
        trace = Simulation(prepare(scenario)).run()
        saturated = trace["saturated_joints"]
        ends[controller] = trace.meta.ending.outcome, np.nanmax(saturated)
    assert ends["passive_convex"][0] is Outcome.JOINT_LIMIT
    assert ends["passive_kinetic"] == (Outcome.COMPLETED, 0.0)


class Drawing:
    """Pulls in circles, and remembers how often it was asked."""

    asked = 0

    def step(self, t_s, seen_tip, handle):
        self.asked += 1
        wrench = np.zeros(6)
        wrench[:2] = 0.5 * np.cos(0.02 * self.asked), 0.5 * np.sin(0.02 * self.asked)
        return HandCommand(wrench=wrench, jaw=0.5, goal=0, done=False, missed=0)


def test_a_fork_keeps_the_hand_in_python():
    setup = prepare(load_scenario("teleop_free_motion_panda"))
    setup.task.hold(Drawing())
    simulation = Simulation(setup)
    simulation.advance(60)
    fork = simulation.fork()
    for one in (simulation, fork):
        one.advance(200)
    a, b = (one.trace() for one in (simulation, fork))
    kept = [k for k, name in enumerate(a.columns) if name != "control_time_s"]
    np.testing.assert_array_equal(a.data[:, kept], b.data[:, kept])
    assert np.ptp(a["handle_x_m"]) > 1e-4


class Failing:
    def step(self, t_s, seen_tip, handle):
        if t_s > 0.0105:
            raise KeyError("no hand")
        return HandCommand(wrench=np.zeros(6), jaw=0.5, goal=0, done=False, missed=0)


def test_what_a_hand_in_python_raises_comes_out_of_the_loop():
    setup = prepare(load_scenario("teleop_free_motion_panda"))
    setup.task.hold(Failing())
    simulation = Simulation(setup)
    with pytest.raises(KeyError, match="no hand"):
        simulation.run()
    assert simulation.time_s == pytest.approx(0.011)
