"""Places: who fails less, then who is better by more than chance and by more than what does not matter."""

import itertools

from surgsim.compare.observations import Observations, metric_named
from surgsim.compare.statistics import Comparison, compare_pair
from surgsim.compare.verdict import Verdict


def places_of(runs: Observations, metric: str) -> dict[str, int]:
    """Place of each controller by `metric`: one, plus the number of controllers that beat it.

    So those that are not told apart share a place.

    Raises:
        SurgsimError: If the metric is unknown.
    """
    places = dict.fromkeys(runs.controllers, 1)
    for a, b in itertools.combinations(runs.controllers, 2):
        if loser := loser_of(compare_pair(runs, a, b, metric), runs.matters(metric)):
            places[loser] += 1
    return places


def loser_of(found: Comparison, matters: float) -> str | None:
    """The controller that the other beats in this comparison, if one does.

    Failures come first: whoever fails more of the paired runs loses, whatever its figures, and among equals
    whoever misses its task more often. Only then do figures speak: the loser loses more than half of the
    pairs, a tie by half, with an interval beyond one half where there is one. And its figure is worse by what
    matters, with an interval that says so if there is one.
    """
    for of_a, of_b in ((found.failed_a, found.failed_b), (found.not_done_a, found.not_done_b)):
        if of_a != of_b:
            return found.a if of_a > of_b else found.b
    won, low, high = found.improvement.value, found.improvement.low, found.improvement.high
    if won is None or won == 0.5 or (low is not None and high is not None and low <= 0.5 <= high):
        return None
    lead = 1 if won > 0.5 else -1  # 1: `a` wins more pairs
    shown = found.verdict is (Verdict.BETTER if lead > 0 else Verdict.WORSE)
    if found.verdict is Verdict.TOO_FEW and found.difference.value:
        better = -1.0 if metric_named(found.metric).lower_is_better else 1.0
        gain = lead * better * found.difference.value
        shown = gain > 0.0 and gain >= matters  # all there is to go by
    return (found.b if lead > 0 else found.a) if shown else None
