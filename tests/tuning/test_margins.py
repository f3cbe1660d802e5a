"""Margins: bisection on made edges, and a delay that is added to the scenario's own."""

import numpy as np
import pytest

from surgsim.simulate.loop import simulate
from surgsim.tuning.margins import GAIN_STEPS, gain_factor, last_passed, whole_step_s
from surgsim.tuning.tune import with_delay


@pytest.mark.parametrize("most", [1, 2, 7, 50, 64])
def test_bisection_finds_every_edge_with_few_questions(most):
    for edge in range(most + 1):
        questions = []

        def passes(level, edge=edge, questions=questions):
            questions.append(level)
            return level <= edge

        assert last_passed(passes, most) == edge
        assert 0 not in questions
        assert len(questions) <= 1 + np.ceil(np.log2(most))


def test_the_factor_goes_to_thirty_in_equal_ratios():
    factors = [gain_factor(level) for level in range(GAIN_STEPS + 1)]
    assert (factors[0], factors[-1]) == (1.0, pytest.approx(30.0))
    np.testing.assert_allclose(np.diff(np.log(factors)), np.log(30.0) / 64, rtol=1e-9)


def test_an_extra_delay_adds_to_the_scenario_s(scenario):
    def delayed(delay_s):
        return scenario(f"disturbances=[{{type: actuation_delay, delay_s: {delay_s}}}]")

    added = simulate(with_delay(delayed(0.002), 0.003))
    whole = simulate(delayed(0.005))
    for block in ("q", "v", "tau", "tip"):
        np.testing.assert_array_equal(added.block(block), whole.block(block))
    assert not np.array_equal(added.block("q"), simulate(delayed(0.002)).block("q"))


def test_the_step_of_the_delay_is_whole_in_every_scenario(scenario):
    periods = [scenario(f"simulation.control_period_s={period}") for period in (0.002, 0.004, 0.003)]
    assert whole_step_s(periods) == pytest.approx(0.012)
    assert whole_step_s(periods[:1]) == pytest.approx(0.002)
