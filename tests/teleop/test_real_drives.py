"""Teleoperation on real drives: every shipped scenario with `passive_elastic`."""

import pytest

from surgsim.metrics.catalog import compute_metrics
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate
from surgsim.verdict import judge

DRIVES = "robot.drive={friction_spread: 0.2}"
MOST_RCM_MM = 0.3
CONTROLLER = load_scenario("teleop_wall_panda", controller="passive_elastic").controller
WALLED = (  # its walls and its speed limit are its own controller's
    f"controller.torque_law={CONTROLLER.torque_law.model_dump_json()}",
    f"controller.resolver.kinetic_lag_s={CONTROLLER.resolver.kinetic_lag_s}",
    f"controller.resolver.kinetic_share={CONTROLLER.resolver.kinetic_share}",
)
QUICK = ("teleop_wall_lwr4plus", "teleop_tissue_fr3")
OTHERS = (
    "teleop_wall_panda",
    "teleop_wall_fr3",
    "teleop_tissue_panda",
    "teleop_tissue_lwr4plus",
    "teleop_free_motion_panda",
    "teleop_reindexed_panda",
)


def check(trace):
    """It did its task, kept the shaft, and neither tank nor limits gave way."""
    metrics = compute_metrics(trace)
    assert judge(trace, metrics).line().startswith("Done")
    assert metrics["rcm_error_max_mm"] <= MOST_RCM_MM
    assert metrics["tank_deficit_j"] == 0.0
    assert metrics["acceleration_limit_ratio"] <= 1.0 + 1e-6
    assert metrics["relaxed_ticks"] == 0


@pytest.mark.parametrize("name", QUICK)
def test_what_is_touched_neither_moves_the_shaft_nor_makes_energy(name):
    check(simulate(load_scenario(name, controller="passive_elastic", assignments=(DRIVES,))))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", [*QUICK, *OTHERS])
def test_every_scenario_on_further_seeds(name, seed):
    check(simulate(load_scenario(name, controller="passive_elastic", seed=seed, assignments=(DRIVES,))))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_walls_of_the_workspace(seed):
    assignments = (DRIVES, *WALLED)
    check(simulate(load_scenario("teleop_workspace_limits_panda", seed=seed, assignments=assignments)))
