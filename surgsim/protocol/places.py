"""Places of a leaderboard: who is not told apart shares one."""

from collections.abc import Sequence

from surgsim.protocol.score import Score

KEYS = (("levels_held", 0.05), ("done", 0.05))
"""Figures that decide, the first first, and the margin within which they are equal."""


def ordered(scores: Sequence[Score]) -> list[Score]:
    """The furthest first: by levels held, then by runs that did their task; ties by name."""
    return sorted(scores, key=lambda score: (*(-value for value in _values(score)), score.name))


def place_of(scores: Sequence[Score]) -> dict[int, int]:
    """Place of each score, by its `id`: one, plus the scores that are ahead by more than the margin."""
    return {id(score): 1 + sum(_ahead(other, score) for other in scores) for score in scores}


def _ahead(a: Score, b: Score) -> bool:
    """Whether `a` is ahead: by the first figure in which they differ by more than its margin."""
    for (_, margin), x, y in zip(KEYS, _values(a), _values(b), strict=True):
        if abs(x - y) > margin:
            return x > y
    return False


def _values(score: Score) -> list[float]:
    return [float(score.scorecard["figures"][name]["value"] or 0.0) for name, _ in KEYS]
