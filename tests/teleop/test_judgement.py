"""What speaks against a run, on made columns."""

import numpy as np
import pytest

from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate
from surgsim.tasks.success import Success
from surgsim.tasks.teleoperation_program import conducted
from surgsim.teleop.judgement import (
    drift,
    end_speed,
    ends,
    excess_j,
    faults,
    force_fidelity,
    stuck,
    toggles_per_s,
    transmitted_impedance,
)
from surgsim.verdict import judge

T = 0.001
ROWS = 4000
TIME = T * np.arange(ROWS)


class Made(dict):
    """Columns by name; those of three are blocks."""

    def __len__(self):
        return ROWS

    def block(self, name):
        return self[name]


def run(**changes):
    """A run at rest, with tanks and no contact."""
    still, zero = np.zeros((ROWS, 3)), np.zeros(ROWS)
    made = {
        name: still for name in ("handle", "handle_velocity", "tip", "tip_ref", "tip_force", "master_force")
    }
    made |= {"t_s": TIME, "delivered": zero, "delivered_j": zero, "tank_account_residual_j": zero}
    made |= {"tank_operator_j": zero + 0.2, "tank_remote_j": zero + 0.1, "in_flight_j": zero}
    return Made(made | changes)


def along(values):
    return np.column_stack((values, np.zeros((ROWS, 2))))


def test_what_was_stored_may_be_delivered_and_no_more():
    given = np.linspace(0.0, 0.35, ROWS)
    assert excess_j(run(delivered_j=given)) == pytest.approx(0.05)
    without = {name: np.zeros(ROWS) for name in ("tank_operator_j", "tank_remote_j")}
    assert excess_j(run(delivered_j=given, **without)) == pytest.approx(0.35)
    assert faults(run(delivered_j=0.85 * given)) == []
    assert faults(run(delivered_j=given)) == ["it was active: it delivered 50 mJ more than it had stored"]


def test_how_it_ends():
    assert ends(run()) == "rests"
    assert ends(run(handle_velocity=along(0.05 * np.sin(30.0 * TIME)))) == "moves"
    assert ends(run(handle_velocity=along(0.01 * np.exp(TIME) * np.sin(30.0 * TIME)))) == "grows"
    contact = along(np.where((TIME > 2.0) & (np.arange(ROWS) % 50 < 25), 5.0, 0.0))
    assert ends(run(tip_force=contact)) == "chatters"
    assert toggles_per_s(run(tip_force=contact)) == pytest.approx(40.0, abs=1.0)
    assert toggles_per_s(run()) == 0.0


def test_a_medium_that_resists_more_and_less_is_in_contact_all_the_time():
    hovering = along(0.1 + 0.08 * np.sin(2.0 * np.pi * 20.0 * TIME))
    assert toggles_per_s(run(tip_force=hovering)) == 1.0  # it begins
    assert ends(run(tip_force=hovering)) == "rests"
    left = along(np.maximum(0.2 * np.sin(2.0 * np.pi * 20.0 * TIME), 0.0))
    assert toggles_per_s(run(tip_force=left)) == pytest.approx(40.0, abs=1.0)
    assert ends(run(tip_force=left)) == "chatters"


def test_the_end_s_speed_is_the_larger_of_handle_and_tip():
    moved = run(tip=along(0.03 * TIME), handle_velocity=along(np.full(ROWS, 0.02)))
    assert end_speed(moved) == pytest.approx(0.03)
    assert drift(moved) == pytest.approx(0.03 * TIME[-1])


def test_fidelity_is_the_correlation_at_the_delay():
    force = np.sin(TIME) ** 2
    late = np.roll(force, 150)
    assert force_fidelity(run(tip_force=along(force), master_force=along(0.1 * late)), 0.15) > 0.999
    assert force_fidelity(run(tip_force=along(force), master_force=along(1.0 - late)), 0.15) < -0.9
    assert np.isnan(force_fidelity(run(), 0.15))


def test_the_impedance_is_that_which_the_force_was_made_with():
    x, v = 0.01 * np.sin(5.0 * TIME), 0.05 * np.cos(5.0 * TIME)
    place = np.where(TIME < 2.0, 0.03, -0.02)
    contact = np.where((TIME > 0.5) & (TIME < 1.5) | (TIME > 2.5), 3.0, 0.0)
    contact[-1] = 0.0
    made = run(
        handle=along(x + place),
        handle_velocity=along(v),
        master_force=along(-70.0 * (x - 0.002) - 4.0 * v),
        tip_force=along(contact),
    )
    assert transmitted_impedance(made, 0.15) == pytest.approx((70.0, 4.0))
    assert np.isnan(transmitted_impedance(run(), 0.15)).all()


def test_a_run_that_moves_on_has_not_done_its_task_though_its_goals_were_reached():
    found = Success(done=True, reason="1 of 1 goals were reached")
    moving = run(handle_velocity=along(np.full(ROWS, 0.1)))
    assert conducted(found, run()) is found
    assert conducted(found, moving) == Success(
        done=False, reason="1 of 1 goals were reached; it moves at the end, at 100 mm/s"
    )
    person = Success(done=None, reason="a person operated, whose goals nobody counts")
    assert conducted(person, moving) is person
    without = Made({name: values for name, values in moving.items() if name != "delivered"})
    assert conducted(found, without) is found


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({}, "the tip is 50 mm from it"),
        ({"tip_force": along(np.full(ROWS, -2.0))}, "the tip presses on something with 2 N"),
        ({"tip_force": along(2.0 * (TIME < 2.0))}, "the tip is 50 mm from it"),
        ({"setpoint_trust": 1.0 * (TIME < 3.0)}, "nothing arrives at the remote side"),
        (
            {"handle_stop": 2.0 * (TIME >= 3.0)},
            "the handle was on the stop of the console's shoulder joint for 1 s",
        ),
        (
            {"handle_stop": 1.0 * (TIME < 1.5)},
            "the handle was on the stop of the console's yaw joint for 1.5 s",
        ),
        ({"handle_stop": 1.0 * (TIME < 0.5)}, "the tip is 50 mm from it"),
    ],
)
def test_what_kept_an_operator_from_its_goal_is_named(changes, reason):
    assert stuck(run(**changes), np.array([0.03, 0.04, 0.0])) == reason


def test_a_handle_on_its_stop_is_no_success_and_said_in_one_line():
    """A goal that this scale puts outside the console's room."""
    goals = "[{position_m: [0.04, 0.65, -0.03]}]"
    settings = (f"task.goals={goals}", "task.mapping.scale=0.15", "task.duration_s=4.0", "theatre=false")
    trace = simulate(load_scenario("teleop_free_motion_panda", assignments=settings))
    found = judge(trace, {})
    assert found.success is False
    assert found.reason.startswith(
        "the operator was still at goal 1 of 1 when time was up: the handle was on the stop"
    )
    assert "\n" not in found.line()
