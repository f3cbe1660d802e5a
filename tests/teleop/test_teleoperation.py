"""The whole loop without an arm: stability in contact, tanks, and what happens without them."""

import numpy as np
import pytest

from surgsim.teleop.channel import ChannelConfig
from surgsim.teleop.operator import OperatorConfig
from surgsim.teleop.operator_side import OPERATOR_COLUMNS, OperatorSide, OperatorSideConfig
from surgsim.teleop.remote_side import REMOTE_COLUMNS, RemoteSideConfig
from surgsim.teleop.tank import TankConfig

BAD = ChannelConfig(jitter_s=0.005, loss=0.1, duplicate=0.05)
LIGHT_GRIP = OperatorConfig(stiffness_n_per_m=20.0, damping_ns_per_m=1.0)
PUSH = {"push": True, "dwell_s": 3.0}


def sides(mode, **changes):
    return {
        "operator": OperatorSideConfig(passivity=mode, **changes),
        "remote": RemoteSideConfig(passivity=mode),
    }


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
        mode: teleoperate(goals, **sides(mode, operator=LIGHT_GRIP), duration_s=9.0)
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


@pytest.mark.parametrize("stiffness", [200.0, 1000.0])
def test_the_tank_holds_at_any_gain(teleoperate, goal, point_mass, stiffness):
    side = sides("tank", operator=LIGHT_GRIP, stiffness_n_per_m=stiffness)
    run = teleoperate(
        (goal(0.04, 0.0, 0.0, **PUSH),), **side, channel=BAD, mass=point_mass(wall_m=0.02), duration_s=8.0
    )
    assert run["force_scale"].min() < 1.0
    assert run["tank_operator_j"].min() > 0.5 * TankConfig().floor_j
    tanks_hold(run)


def test_an_empty_remote_tank_stops_the_push(teleoperate, goal, point_mass):
    """With nothing from the operator's tank the wall gets what is in the remote one, however far the push."""
    mean = OperatorSideConfig(tank=TankConfig(send_limit_w=0.0))
    small = TankConfig(initial_j=0.02, target_j=0.02, floor_j=0.01)
    stored = {}
    for name, tank in (("small", small), ("large", TankConfig())):
        remote = RemoteSideConfig(tank=tank, drift_speed_m_per_s=0.1)
        run = teleoperate(
            (goal(0.05, 0.0, 0.0, **PUSH),),
            operator=mean,
            remote=remote,
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
    names = [name for block in (*OPERATOR_COLUMNS, *REMOTE_COLUMNS) for name in block.columns]
    assert len(set(names)) == len(names)
    assert all(np.isfinite(run[name]).all() for name in names)


def test_another_hand_can_hold_the_handle():
    class Nobody:
        def step(self, t_s, seen_tip, handle):
            from surgsim.teleop.operator import HandCommand

            return HandCommand(wrench=np.zeros(6), jaw=0.5, goal=0, done=False, missed=0)

    side = OperatorSide(
        OperatorSideConfig(), (), np.zeros(3), "power", np.random.SeedSequence(0), hand=Nobody()
    )
    for k in range(100):
        sent = side.step(k * 0.001, [])
    assert sent.message.position == pytest.approx(np.zeros(3), abs=1e-9)
    assert sent.message.jaw == 0.5
