"""The finding of a comparison in words, with its figures."""

from surgsim.compare.figure_text import bracket, counted, exactly, heading_of, with_unit
from surgsim.compare.intervals import Interval
from surgsim.compare.paired_runs import Pairs
from surgsim.compare.verdict import Verdict
from surgsim.metrics.metric import Metric


def sentence_of(a: str, b: str, metric: Metric, pairs: Pairs, difference: Interval, verdict: Verdict) -> str:
    """The verdict on `a` in words; failures, and tasks that were not done, are said in every case."""
    found = _finding(a, b, metric, pairs, difference, verdict)
    for what, of_a, of_b in (
        ("Failed", pairs.failed_a, pairs.failed_b),
        ("Completed, task not done", pairs.not_done_a, pairs.not_done_b),
    ):
        if of_a or of_b:
            found += f" {what}: {a} {of_a}, {b} {of_b} of {_paired(pairs)} pairs."
    return found


def _finding(a: str, b: str, metric: Metric, pairs: Pairs, difference: Interval, verdict: Verdict) -> str:
    unit = heading_of(metric)[1]
    value, least = difference.value or 0.0, exactly(pairs.matters, unit)
    match verdict:
        case Verdict.TOO_FEW:
            return _too_few(a, b, metric, pairs, difference)
        case Verdict.EQUAL:
            return f"No difference: {a} and {b} give the same value with every seed."
        case Verdict.NOT_TOLD_APART:
            return f"{_not_told_apart(pairs, difference, unit)}."
        case Verdict.EQUIVALENT:
            size = f"{with_unit(value, bracket(difference))} {unit}".rstrip()
            return f"Equivalent: {size}, inside ±{least}{_still(pairs)}."
    by = f"{with_unit(abs(value), unit)}{_relative(pairs)}"
    by += f" {_absolute(difference)}" if not difference.note else ", seeds do not matter"
    by += _unless(pairs, value)
    found = f"{a} is {side(metric, value)} than {b} by {by}"
    return (
        f"{found}; whether by {least}, the least that matters, is open."
        if verdict is Verdict.PERHAPS
        else f"{found}."
    )


def _not_told_apart(pairs: Pairs, difference: Interval, unit: str) -> str:
    """That the interval holds zero, and how large a difference it still allows."""
    size = f"{with_unit(difference.value, bracket(difference))} {unit}".rstrip()
    if not pairs.matters:
        return f"Not told apart: {size}"
    return f"Not told apart, nor equivalent within ±{exactly(pairs.matters, unit)}: {size}"


def side(metric: Metric, difference: float) -> str:
    """What the first is where it differs from the second by `difference`."""
    if metric.lower_is_better is None:
        return "lower" if difference < 0.0 else "higher"
    return "better" if (difference < 0.0) == metric.lower_is_better else "worse"


def _too_few(a: str, b: str, metric: Metric, pairs: Pairs, difference: Interval) -> str:
    """Why there is no interval, and what was seen all the same."""
    if not pairs.count or difference.value is None:
        return f"Too few pairs: none ({counted(pairs.left_out) or 'no runs'})."
    unit, value = heading_of(metric)[1], difference.value
    reason = difference.note.removesuffix(": no interval")
    if abs(value) < pairs.matters or value == 0.0:
        least = f", less than {exactly(pairs.matters, unit)}{_still(pairs)}" if value else ""
        return f"Too few pairs ({reason}). Seen: {with_unit(value, unit)}{least}."
    seen = f"{a} {side(metric, value)} than {b} by {with_unit(abs(value), unit)}{_unless(pairs, value)}"
    return f"Too few pairs ({reason}). Seen: {seen}."


def _unless(pairs: Pairs, value: float) -> str:
    """In how many scenarios the difference goes the other way, or is less than matters."""
    sign = 1.0 if value > 0.0 else -1.0
    means = [sign * float(stratum.mean()) for stratum in pairs.differences]
    other = sum(mean <= 0.0 or mean < pairs.matters for mean in means)
    return f", but not in {other} of {len(means)} scenarios" if other else ""


def _still(pairs: Pairs) -> str:
    """In how many scenarios a difference matters although the mean over all does not."""
    some = sum(abs(float(stratum.mean())) >= pairs.matters for stratum in pairs.differences)
    return f", but not in {some} of {len(pairs.differences)} scenarios" if some else ""


def _absolute(difference: Interval) -> str:
    """Interval of the difference's size: an interval that excludes 0 loses its sign."""
    ends = sorted(abs(end) for end in (difference.low, difference.high) if end is not None)
    return bracket(Interval(value=None, low=ends[0], high=ends[-1]))


def _relative(pairs: Pairs) -> str:
    """The difference in percent of `b`, where that says something."""
    if not (pairs.mean_b > 0.0 and pairs.mean_a > 0.0):
        return ""
    change = 100.0 * (pairs.mean_a / pairs.mean_b - 1.0)
    digits = 1 if change < -99.0 else 0  # a little is left of b
    return f" ({change:+.{digits}f} %)".replace("-", "−") if 1.0 <= abs(change) <= 1000.0 else ""


def _paired(pairs: Pairs) -> int:
    missing = sum(count for reason, count in pairs.left_out.items() if reason.endswith("missing"))
    return pairs.count + sum(pairs.left_out.values()) - missing
