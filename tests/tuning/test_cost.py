"""The cost of made runs, by hand."""

import math

import pytest

from surgsim.tuning.cost import WEIGHTS, Trial, Weights, cost


def run(outcome="completed", t_s=3.0, **metrics):
    return Trial(scenario="s", seed=1000, outcome=outcome, t_s=t_s, detail="", metrics=metrics)


def good(rcm, tip, **others):
    return run(rcm_error_rms_mm=rcm, tip_error_rms_mm=tip, **others)


def test_completed_runs_cost_the_mean_logarithm_of_both_errors():
    runs = [good(0.99, 1.99), good(0.09, 0.49)]
    assert cost(runs) == pytest.approx(0.5 * (math.log(1.0 * 2.0) + math.log(0.1 * 0.5)))


def test_an_error_of_nothing_costs_the_floor():
    assert cost([good(0.0, 0.0)]) == pytest.approx(2.0 * math.log(0.01))
    assert cost([good(0.0, 0.0)], Weights(floor_mm=1.0)) == 0.0


def test_a_metric_that_is_not_defined_adds_nothing():
    assert cost([good(None, 0.99)]) == pytest.approx(0.0)
    assert cost([run()]) == 0.0


def test_of_several_arms_the_mean_of_their_terms_counts():
    both = run(
        left_rcm_error_rms_mm=0.99,
        left_tip_error_rms_mm=None,
        left_saturated_fraction=0.11,
        right_rcm_error_rms_mm=0.09,
        right_tip_error_rms_mm=0.49,
        right_saturated_fraction=0.0,
    )
    expected = 0.5 * (math.log(1.0) + math.log(0.1)) + math.log(0.5) + 20.0 * 0.5 * 0.1
    assert cost([both]) == pytest.approx(expected)


@pytest.mark.parametrize("name", ["torque_rate_over_fraction", "saturated_fraction"])
def test_a_share_costs_from_one_per_cent_on(name):
    plain = cost([good(0.5, 0.5)])
    assert cost([good(0.5, 0.5, **{name: 0.01})]) == plain
    assert cost([good(0.5, 0.5, **{name: 0.06})]) == pytest.approx(plain + 20.0 * 0.05)
    assert cost([good(0.5, 0.5, **{name: None})]) == plain


def test_failed_runs_cost_by_their_number_and_then_by_how_early_they_failed():
    at_once, later, much_later = (run("rcm_limit", t_s=t) for t in (0.0, 1.0, 9.0))
    assert cost([at_once]) == pytest.approx(1100.0)
    assert cost([later]) == pytest.approx(1050.0)
    assert cost([at_once, much_later]) == pytest.approx(1100.0 + 1010.0)
    assert cost([later, good(0.99, 0.99)]) == pytest.approx(1050.0)


@pytest.mark.parametrize("outcome", ["diverged", "refused", "crashed", "worker_died", "joint_limit"])
def test_whatever_does_not_complete_has_failed_whatever_its_errors(outcome):
    rough = {"torque_rate_over_fraction": 1.0, "saturated_fraction": 1.0}
    worst = [good(1e3, 1e3, **rough)] * 6
    assert cost([*worst[1:], run(outcome, t_s=1e3, rcm_error_rms_mm=0.0)]) > cost(worst)


def test_one_failure_is_better_than_two_whenever_they_were():
    late = run("tip_limit", t_s=1e6)
    assert cost([run("tip_limit", t_s=0.0), good(1e3, 1e3)]) < cost([late, late])
    assert WEIGHTS.early < WEIGHTS.failure
