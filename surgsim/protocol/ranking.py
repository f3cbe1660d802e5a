"""Places of a leaderboard: who is not told apart shares one."""

from collections.abc import Sequence

from surgsim.protocol.definition import ProtocolConfig
from surgsim.protocol.score import Score

_KINDS = ("held", "done")
"""Kinds of figures that decide, the first first."""


def ordered(scores: Sequence[Score], protocol: ProtocolConfig) -> list[Score]:
    """By place; who shares one by levels held, then by runs that did their task, then by name."""
    places = place_of(scores, protocol)

    def key(score: Score) -> tuple[float | str, ...]:
        return places[id(score)], *(-value for value, _ in _values(score, protocol)), score.name

    return sorted(scores, key=key)


def place_of(scores: Sequence[Score], protocol: ProtocolConfig) -> dict[int, int]:
    """Place of each score, by its `id`: one, plus the scores that are ahead of it by more than the margin."""
    return {
        id(score): 1 + sum(_ahead(_values(other, protocol), _values(score, protocol)) for other in scores)
        for score in scores
    }


def _ahead(a: Sequence[tuple[float, float]], b: Sequence[tuple[float, float]]) -> bool:
    """Whether `a` is ahead: by the first figure in which they differ by more than its margin."""
    for (x, margin), (y, _) in zip(a, b, strict=True):
        if abs(x - y) > margin:
            return x > y
    return False


def _values(score: Score, protocol: ProtocolConfig) -> list[tuple[float, float]]:
    """The deciding figures of a score, each with its margin; one without a value counts as 0."""
    return [
        (float(score.scorecard["figures"][name]["value"] or 0.0), figure.margin)
        for kind in _KINDS
        for name, figure in protocol.figures.items()
        if figure.kind == kind
    ]
