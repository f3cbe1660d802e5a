"""Forces on wall and tip: known values, and none where nothing measures them."""

import numpy as np
import pytest

from surgsim.columns import vector
from surgsim.metrics.catalog import METRICS, compute_metrics
from surgsim.simulate.loop import simulate
from surgsim.trace.trace import Trace

FORCES = np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 2.0]])


def _with(trace, name, force):
    data = np.column_stack([trace.data, force])
    return Trace(data, (*trace.blocks, vector(name, "n")), trace.meta)


def _values(trace, names):
    return {name: METRICS[name].compute(trace) for name in names}


def test_trocar_force(trace_of):
    trace = _with(trace_of(4, period_s=0.1), "trocar_force", FORCES)
    names = ("trocar_force_rms_n", "trocar_force_max_n", "trocar_impulse_n_s")
    expected = (np.sqrt(30.0 / 4.0), 5.0, 0.1 * (2.5 + 0.0 + 1.0 + 1.0))
    assert _values(trace, names) == pytest.approx(dict(zip(names, expected, strict=True)))


def test_tip_force(trace_of):
    assert METRICS["tip_force_max_n"].compute(_with(trace_of(4), "tip_force", FORCES)) == 5.0


def test_forces_in_the_stop_count_from_its_row_on_and_only_there(trace_of):
    trace = _with(trace_of(4, stopped=[0.0, 0.0, 1.0, 1.0]), "trocar_force", FORCES)
    assert METRICS["stop_trocar_force_max_n"].compute(trace) == 2.0
    assert METRICS["trocar_force_max_n"].compute(trace.active()) == 5.0


def test_the_catalog_measures_the_run_and_not_its_stop(scenario):
    run = simulate(scenario("safety.tip_error_max_m=5e-5"))
    values = compute_metrics(run)
    assert values["tip_error_max_mm"] == 1e3 * run.active()["tip_error_m"].max()
    sides = ("trocar_force_rms_n", "trocar_force_max_n", "trocar_impulse_n_s", "tip_force_max_n")
    assert all(values[name] is None for name in (*sides, "stop_trocar_force_max_n", "stop_tip_force_max_n"))
