"""The result of a batch in a few sentences: who wins, by how much, how sure, and where each fails."""

from collections.abc import Sequence
from dataclasses import dataclass

from surgsim.compare.failures import Failing, failing
from surgsim.compare.figure_text import exactly, heading_of, listed, number, seeds_of, with_unit
from surgsim.compare.leaderboard import LeaderboardRow
from surgsim.compare.observations import Observations, metric_named
from surgsim.compare.sentences import side
from surgsim.compare.statistics import Comparison, chance_of_failures, compare_pair
from surgsim.compare.verdict import Verdict
from surgsim.metrics.metric import Metric


@dataclass(frozen=True, kw_only=True)
class Summary:
    """A batch by one metric, in words.

    Attributes:
        winners: Controllers that share the first place; empty where nothing sets any apart.
        first: Who wins, by how much and how sure.
        least: The smallest difference that matters and where it comes from; empty if any difference does.
        failing: Where each controller fails.
    """

    winners: tuple[str, ...]
    first: str
    least: str
    failing: tuple[Failing, ...]

    @property
    def lines(self) -> list[str]:
        """All of it, a sentence a line."""
        where = [f"  {one.sentence}." for one in self.failing]
        return [line for line in (self.first, self.least) if line] + ["Where each fails:", *where]


def summary(runs: Observations, metric: str, rows: Sequence[LeaderboardRow]) -> Summary:
    """The summary by `metric`.

    Args:
        runs: The batch.
        metric: Name of the metric.
        rows: Its leaderboard, with places.

    Raises:
        SurgsimError: If the metric is unknown.
    """
    spec, matters = metric_named(metric), runs.matters(metric)
    winners, first = _first(runs, spec, rows)
    return Summary(winners=winners, first=first, least=_least(spec, matters), failing=tuple(failing(runs)))


def _first(runs: Observations, metric: Metric, rows: Sequence[LeaderboardRow]) -> tuple[tuple[str, ...], str]:
    words, unit = heading_of(metric)
    valued = [row for row in rows if row.value.value is not None]
    if not valued:
        return (), f"No run completed with a value of {words}."
    if len(rows) == 1:
        return (), f"{valued[0].controller} alone was run: {words} {with_unit(valued[0].value.value, unit)}."
    ordered = sorted(rows, key=_by_place)
    winners = tuple(row.controller for row in ordered if row.place == 1)
    others = [row for row in ordered if row.place != 1]
    if not others or not winners:
        if len(valued) == 1:
            value = with_unit(valued[0].value.value, unit)
            return (), f"{valued[0].controller} alone has a value of {words}: {value}."
        last = compare_pair(runs, valued[0].controller, valued[-1].controller, metric.name)
        finding = last.sentence[0].lower() + last.sentence[1:]
        pair = f"{last.a} against {last.b}, first and last"
        return (), f"Nobody wins by {words}: no controller is told apart. {pair}: {finding}"
    found = compare_pair(runs, winners[0], others[0].controller, metric.name)
    sharing = sum(row.place == others[0].place for row in others) - 1
    told = _by_how_much(found, metric, runs.matters(metric.name), len(winners) > 1, sharing)
    return winners, f"{_who(winners, words)}{told}"


def _by_place(row: LeaderboardRow) -> tuple[int, float]:
    return row.place or 0, float("inf") if row.rank.value is None else row.rank.value


def _who(winners: Sequence[str], words: str) -> str:
    if len(winners) == 1:
        return f"{winners[0]} wins by {words}: "
    return f"{listed(winners)} share the first place by {words}: "


def _by_how_much(found: Comparison, metric: Metric, matters: float, several: bool, sharing: int) -> str:
    """The best of the winners against the next, in means over their pairs, and how sure that is.

    Args:
        found: Their comparison.
        metric: Its metric.
        matters: Smallest difference that matters.
        several: Whether there are several winners, so that the best of them is to be named.
        sharing: How many others share the place of the next.
    """
    unit, value = heading_of(metric)[1], found.difference.value
    also = f" ({sharing} more share its place)" if sharing > 0 else ""
    if found.mean_a is None or found.mean_b is None or value is None:
        return f"of the next, {found.b}{also}, no run completed beside one of {found.a}."
    best = f"{found.a} with " if several else ""
    text = f"{best}{with_unit(found.mean_a, unit)} on average. Next comes {found.b}{also}"
    if found.verdict in (Verdict.NOT_TOLD_APART, Verdict.EQUIVALENT, Verdict.PERHAPS):  # failures decide
        decided = f" Failures decide{_by_chance(found)}." if found.failed_a != found.failed_b else ""
        return f"{text} with {with_unit(found.mean_b, unit)}. {found.sentence}{decided}"
    size = f"{with_unit(abs(value), unit)} {side(metric, -value)}{_ratio(found, metric, matters)}"
    return (
        f"{text} with {with_unit(found.mean_b, unit)}, {size}{_how_sure(found, unit)}.{_failing_more(found)}"
    )


def _failing_more(found: Comparison) -> str:
    """That the second fails more often, which puts it behind whatever its figures."""
    if found.failed_a != found.failed_b:
        counts = f"{found.failed_b} of its paired runs against {found.failed_a}"
        return f" {found.b} fails more often: {counts}{_by_chance(found)}."
    if found.not_done_a != found.not_done_b:
        counts = f"in {found.not_done_b} paired runs against {found.not_done_a}"
        return f" {found.b} misses its task more often: {counts}."
    return ""


def _by_chance(found: Comparison) -> str:
    """How likely the failures are so unequal by chance; empty where they are equal."""
    if found.failed_a == found.failed_b:
        return ""
    return f" (p = {number(chance_of_failures(found), 2)} by chance alone)"


def _ratio(found: Comparison, metric: Metric, matters: float) -> str:
    """How many times larger the worse of two means is, where that says something: not of next to nothing."""
    a, b = found.mean_a or 0.0, found.mean_b or 0.0
    if (
        not (a >= matters and a > 0.0 and b > 0.0)
        or metric.lower_is_better is not True
        or not 2.0 <= b / a < 1e6
    ):
        return ""
    return f" ({number(b / a, 2)} times as much)"


def _how_sure(found: Comparison, unit: str) -> str:
    """The interval, or why there is none."""
    difference, seeds = found.difference, seeds_of(found.seeds)
    if difference.low is not None and difference.high is not None:
        low, high = sorted((abs(difference.low), abs(difference.high)))
        return f"; 95 % interval {number(low)} to {with_unit(high, unit)}, from {seeds}"
    if found.verdict is Verdict.TOO_FEW:
        return f"; how sure is not known: no interval from {seeds}"
    return f"; chance has no part in it, all of {seeds} give the same"


def _least(metric: Metric, matters: float) -> str:
    """What counts as no difference."""
    if not matters:
        return ""
    words, unit = heading_of(metric)
    source = f"that is {metric.matters_source}" if matters == metric.matters else "set for this batch"
    return f"By {words}, controllers less than {exactly(matters, unit)} apart count as equal; {source}."
