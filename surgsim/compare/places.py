"""Places: who is better than whom, by more than chance and by more than what does not matter."""

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

    It loses more than half of the pairs, a failure to a run that completed, and a tie by half; where there
    is an interval, that lies beyond one half. And its figure is worse by what matters, with an interval that
    says so if there is one, or it fails more often, or misses its task more often.
    """
    won, low, high = found.improvement.value, found.improvement.low, found.improvement.high
    if won is None or won == 0.5 or (low is not None and high is not None and low <= 0.5 <= high):
        return None
    lead = 1 if won > 0.5 else -1  # 1: `a` wins more pairs
    wrecks = lead * ((found.failed_b - found.failed_a) or (found.not_done_b - found.not_done_a))
    shown = found.verdict is (Verdict.BETTER if lead > 0 else Verdict.WORSE)
    if found.verdict is Verdict.TOO_FEW and found.difference.value:
        better = -1.0 if metric_named(found.metric).lower_is_better else 1.0
        gain = lead * better * found.difference.value
        shown = gain > 0.0 and gain >= matters  # all there is to go by
    return (found.b if lead > 0 else found.a) if wrecks > 0 or (wrecks == 0 and shown) else None
