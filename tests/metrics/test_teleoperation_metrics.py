"""Metrics of teleoperation: known values on synthetic traces."""

import numpy as np
import pytest

from surgsim.columns import scalar, vector
from surgsim.metrics import teleoperation
from surgsim.metrics.catalog import METRICS
from surgsim.trace.trace import Trace

ROWS, PERIOD_S = 8, 0.01
STILL = np.zeros((ROWS, 3))


def _trace(trace_of, blocks):
    """A trace with further blocks, as {name: (unit, values)}, and a tip that moves at 10 mm/s along x."""
    base = trace_of(ROWS, period_s=PERIOD_S)
    data, kinds = base.data.copy(), list(base.blocks)
    at = [name for block in kinds for name in block.columns].index("tip_x_m")
    data[:, at : at + 3] = 0.0
    data[:, at] = 0.01 * PERIOD_S * np.arange(ROWS)
    for name, (unit, values) in blocks.items():
        values = np.asarray(values, dtype=float).reshape(ROWS, -1)
        kinds.append((vector if values.shape[1] == 3 else scalar)(name, unit))
        data = np.column_stack([data, values])
    return Trace(data, tuple(kinds), base.meta)


def _row(*values):
    return np.tile(values, (ROWS, 1))


def _value(trace, name):
    return METRICS[name].compute(trace)


def test_velocity_errors_are_of_the_tip_s_true_velocity(trace_of):
    blocks = {
        "velocity_command": ("m_per_s", _row(0.01, 0.003, 0.0)),
        "velocity_issued": ("m_per_s", _row(0.0, 0.0, 0.0)),
    }
    trace = _trace(trace_of, blocks)
    assert _value(trace, "velocity_error_rms_mm_per_s") == pytest.approx(3.0)
    assert _value(trace, "velocity_error_unaligned_rms_mm_per_s") == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("name", "unit", "busy"),
    [
        ("slack", "m_per_s", [0.0, 2e-4, 0.0]),
        ("tip_force", "n", [0.0, 0.0, 0.2]),
        ("passivity_active", "", [1.0]),
        ("planes_active", "", [2.0]),
        ("qp_relaxed", "", [1.0]),
    ],
)
def test_ticks_in_which_something_holds_the_tip_back_do_not_count(trace_of, name, unit, busy):
    command, values = _row(0.01, 0.0, 0.0), np.zeros((ROWS, len(busy)))
    command[3], values[3] = 5.0, busy
    blocks = {"velocity_command": ("m_per_s", command)}
    assert _value(_trace(trace_of, blocks), "velocity_error_rms_mm_per_s") > 100.0
    held = _trace(trace_of, {**blocks, name: (unit, values)})
    assert _value(held, "velocity_error_rms_mm_per_s") == pytest.approx(0.0, abs=1e-9)


LEDGER = ("console_residual", "energy_residual", "tank_account_residual", "energy_contact_work")


def _ledger(**given):
    blocks = {"velocity_command": ("m_per_s", STILL)}
    for name in (*LEDGER, "hand_work", "environment_work"):
        blocks[name] = ("j", given.get(name, np.zeros(ROWS)))
    return blocks


def test_residuals_of_the_parts_do_not_cancel(trace_of):
    one = np.full(ROWS, 1e-3)
    blocks = _ledger(console_residual=one, energy_residual=-one, tank_account_residual=one)
    blocks["hand_work"] = ("j", np.linspace(0.0, 0.1, ROWS))
    trace = _trace(trace_of, blocks)
    assert _value(trace, "energy_residual_j") == pytest.approx(3e-3)
    assert _value(trace, "energy_residual_fraction") == pytest.approx(3e-2)


def test_work_that_the_tank_books_must_be_the_contact_s(trace_of):
    work = np.linspace(0.0, 7.0, ROWS)
    blocks = _ledger(environment_work=work, energy_contact_work=-np.concatenate(([0.0], work[:-1])))
    assert _value(_trace(trace_of, blocks), "energy_residual_j") == pytest.approx(0.0, abs=1e-12)
    blocks["environment_work"] = ("j", 1.1 * work)
    assert _value(_trace(trace_of, blocks), "energy_residual_j") == pytest.approx(0.6)


def test_the_work_to_and_fro_is_exchanged_energy(trace_of):
    blocks = _ledger(hand_work=[0, 1, 0, 1, 0, 1, 0, 1], environment_work=[0, 0, 0, 0, 2, 2, 2, 2])
    assert teleoperation.energy_exchanged(_trace(trace_of, blocks)) == 9.0


def test_what_empty_tanks_gave_and_how_hard_the_command_was_changed(trace_of):
    deficit = np.linspace(0.0, 0.07, ROWS)
    blocks = {
        **_ledger(),
        "tank_operator_deficit": ("j", 0.5 * deficit),
        "tank_remote_deficit": ("j", deficit),
    }
    trace = _trace(trace_of, {**blocks, "velocity_command": ("m_per_s", STILL)})
    assert _value(trace, "tank_deficit_j") == pytest.approx(0.105)
    qdot = np.zeros((ROWS, 7))
    qdot[3:, 2] = -0.4
    first = next(block.columns[0] for block in trace.blocks if block.name == "qdot_ref")
    at = [name for block in trace.blocks for name in block.columns].index(first)
    data = trace.data.copy()
    data[:, at : at + 7] = qdot
    trace = Trace(data, trace.blocks, trace.meta)
    limit = trace.meta.limits["acceleration"][2]
    assert _value(trace, "acceleration_limit_ratio") == pytest.approx(0.4 / PERIOD_S / limit)


def test_tanks_master_and_operator(trace_of):
    level = np.full(ROWS, 0.2)
    low = level.copy()
    low[4] = 0.05
    done = (np.arange(ROWS) >= 5).astype(float)
    blocks = {
        **_ledger(),
        "tank_operator": ("j", level),
        "tank_remote": ("j", low),
        "delivered": ("j", [-1, 0, 0.1, 0.3, 0, 0, 0, 0]),
        "master_force": ("n", _row(0.0, 3.0, -4.0)),
        "operator_done": ("", done),
        "goals_missed": ("", done),
        "slack": ("m_per_s", _row(0.003, 0.004, 0.0)),
        "passivity_active": ("", done),
        "qp_relaxed": ("", done),
    }
    trace = _trace(trace_of, blocks)
    expected = {
        "tank_min_j": 0.05,
        "delivered_max_j": 0.3,
        "master_force_max_n": 5.0,
        "task_time_s": 0.05,
        "goals_missed": 1.0,
        "slack_rms_mm_per_s": 5.0,
        "passivity_active_fraction": 3.0 / 8.0,
        "relaxed_ticks": 3.0,
    }
    assert {name: _value(trace, name) for name in expected} == pytest.approx(expected)


def test_without_tanks_there_is_no_level(trace_of):
    blocks = _ledger(tank_account_residual=np.full(ROWS, np.nan))
    blocks |= {"tank_operator": ("j", np.ones(ROWS)), "tank_remote": ("j", np.ones(ROWS))}
    assert np.isnan(_value(_trace(trace_of, blocks), "tank_min_j"))


def test_other_traces_have_none_of_them(trace_of):
    trace = trace_of(4)
    assert all(np.isnan(metric.compute(trace)) for metric in teleoperation.METRICS)
