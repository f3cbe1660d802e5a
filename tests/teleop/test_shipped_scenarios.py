"""Every shipped teleoperation: done, passive, and the shaft stays in the port."""

import pytest

from surgsim.errors import Outcome
from surgsim.metrics.catalog import compute_metrics
from surgsim.scenario.load import load_scenario, shipped
from surgsim.simulate.loop import simulate

NAMES = [name for name in shipped() if name.startswith("teleop_")]
ON_REAL_DRIVES = ("robot.drive=real", "controller.torque_law={type: rcm_elastic_dynamics}")


def done(name, *assignments):
    """Metrics of a run that did its task, which it does only if it was passive and ends at rest."""
    scenario = load_scenario(name, assignments=assignments)
    trace = simulate(scenario)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    success = scenario.task.success(trace.active())
    assert success.done, success.reason
    metrics = compute_metrics(trace)
    assert metrics["tank_deficit_j"] == 0.0
    assert metrics["energy_residual_fraction"] < 0.01
    return metrics


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_teleoperation_is_done_passively_within_its_port(name):
    metrics = done(name)
    assert metrics["rcm_error_max_mm"] <= 0.05
    assert metrics["relaxed_ticks"] == 0.0
    assert metrics["acceleration_limit_ratio"] <= 1.0 + 1e-6


@pytest.mark.parametrize("name", ["teleop_free_motion_panda", "teleop_reindexed_panda"])
def test_real_drives_keep_the_shaft_in_its_port_where_nothing_is_touched(name):
    assert done(name, *ON_REAL_DRIVES)["rcm_error_max_mm"] <= 0.3


def test_the_re_indexed_scenario_uses_clutch_scale_roll_and_filter():
    trace = simulate(load_scenario("teleop_reindexed_panda"))
    metrics = compute_metrics(trace)
    assert metrics["clutchings"] >= 1.0
    assert set(trace["motion_scale"][[0, -1]]) == {0.15, 0.3}
    assert 0.15 < metrics["motion_scale_mean"] < 0.3
    assert trace["roll_rad"].max() > 1.0
    assert trace["roll_rad"].min() < -1.0
    assert metrics["roll_error_rms_deg"] < 1.0
    assert metrics["tremor_transmission"] < 0.7
