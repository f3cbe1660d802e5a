"""How far gains are from failing: more delay, and higher gains, until a run does not complete."""

import math
from collections.abc import Callable, Sequence

from surgsim.scenario.arms import Experiment, each_arm
from surgsim.tuning.gains import RANGE, Gain, Values
from surgsim.tuning.trials import Report, Trials
from surgsim.tuning.tune import cases_of
from surgsim.tuning.tuning import Margins, Tuning

DELAY_MOST_S = 0.05
"""Longest extra actuation delay that is tried [s]."""
GAIN_STEPS = 64
"""Steps of the gains' factor, equal in log space, from 1 to the largest."""
_NS = 1e9


def measure_margins(tuning: Tuning, trials: Trials, report: Report) -> None:
    """Find the margins of the best candidate; there are none where it fails itself.

    The delay is added to those that the scenarios have, in whole control periods; the factor is on all tuned
    gains, within what the controller's file allows. Both are found by `last_passed`.
    """
    best, runs, step_s = tuning.best, 0, whole_step_s(tuning.scenarios)
    most = _most_delay(tuning.scenarios)

    def completes(values: Values, delay_s: float = 0.0) -> bool:
        nonlocal runs
        found = trials.of(list(cases_of(tuning, best.number, values, delay_s)), report)
        runs += len(found)
        return all(trial.completed for trial in found)

    delay, factor = None, None
    if all(trial.completed for trial in best.trials):
        if most > 0:
            delay = step_s * last_passed(lambda k: completes(best.values, k * step_s), most)
        factor = gain_factor(
            last_passed(lambda k: completes(_scaled(tuning.gains, best.values, gain_factor(k))), GAIN_STEPS)
        )
    tuning.margins = Margins(
        delay_s=delay,
        delay_most_s=most * step_s,
        gain_factor=factor,
        gain_most=gain_factor(GAIN_STEPS),
        runs=runs,
    )


def most_runs(tuning: Tuning) -> int:
    """The most runs that `measure_margins` can take."""
    levels = (_most_delay(tuning.scenarios), GAIN_STEPS)
    return len(tuning.scenarios) * sum(1 + math.ceil(math.log2(most)) for most in levels if most > 0)


def _most_delay(scenarios: Sequence[Experiment]) -> int:
    """The most steps of delay; none where torques do not act."""
    if not all(arm.plant.uses_torque for scenario in scenarios for arm in each_arm(scenario)):
        return 0
    return math.floor(DELAY_MOST_S / whole_step_s(scenarios) + 1e-9)


def _scaled(gains: Sequence[Gain], values: Values, factor: float) -> Values:
    return {gain.key: gain.scaled(values[gain.key], factor) for gain in gains}


def whole_step_s(scenarios: Sequence[Experiment]) -> float:
    """The shortest time that is a whole number of control periods in every scenario [s]."""
    return math.lcm(*(round(scenario.simulation.control_period_s * _NS) for scenario in scenarios)) / _NS


def last_passed(passes: Callable[[int], bool], most: int) -> int:
    """The largest level from 0 to `most` that passes, by bisection; 0 passes without being asked.

    The largest is asked first. It is the edge of what passes where that has one; where levels pass above one
    that does not, it is an edge below such a level, or `most`.
    """
    if passes(most):
        return most
    low, high = 0, most
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if passes(middle) else (low, middle)
    return low


def gain_factor(level: int) -> float:
    """Factor on all gains at a level from 0 to `GAIN_STEPS`."""
    return float(RANGE ** (level / GAIN_STEPS))
