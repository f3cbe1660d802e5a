"""Tables and progress as a person reads them: data on stdout, progress on stderr."""

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from surgsim.cli.kernels import on_screen
from surgsim.cli.table import fit_prose, print_prose, print_table, terminal_width
from surgsim.compiled.watch import working_time
from surgsim.display import number
from surgsim.simulate.loop import Progress as ProgressCall

if TYPE_CHECKING:
    from surgsim.compare.intervals import Interval
    from surgsim.compare.leaderboard import LeaderboardRow
    from surgsim.trace.trace import Trace


def print_paragraphs(lines: Sequence[str]) -> None:
    """Print lines, broken between words, and an empty one after them; what goes on is indented further."""
    width = min(80, terminal_width(sys.stdout))
    for line in lines:
        text = line.lstrip()
        indent = " " * (len(line) - len(text))
        first, *others = fit_prose(text, width - len(indent) - 2)
        print("\n".join([indent + first, *(f"{indent}  {other}" for other in others)]))
    print()


def print_metrics(title: str, metrics: Mapping[str, float | None], arms: Sequence[str] = ()) -> None:
    """Print the metrics of a run with their meanings; subjects of which it defines none are left out.

    Args:
        title: Above the table.
        metrics: By name.
        arms: Names of the arms where there are several: a column for each.
    """
    from surgsim.metrics.catalog import GROUPS, of_one_arm

    columns = [of_one_arm(metrics, arm) for arm in arms] or [dict(metrics)]
    rows = [
        (metric.name, *(number(column[metric.name], metric.digits) for column in columns), metric.meaning)
        for group in GROUPS
        if any(column.get(metric.name) is not None for metric in group for column in columns)
        for metric in group
        if all(metric.name in column for column in columns)
    ]
    values = tuple(range(1, 1 + len(columns)))
    print_table(title, ("metric", *(arms or ("value",)), "meaning"), rows, right=values)


def print_run(trace: "Trace", metrics: Mapping[str, float | None]) -> None:
    """Print a run's metrics, whether its task was done, and how it ended."""
    from surgsim.verdict import judge, judge_each

    scenario, ending = trace.meta.scenario, trace.meta.ending
    title = f"{scenario['name']}, {trace.meta.controller}, seed {scenario['seed']}"
    print_metrics(title, metrics, trace.arms)
    sentence = ending.outcome.value.removesuffix(".")
    detail = f" ({ending.detail})" if ending.detail else ""
    print()
    for arm, verdict in judge_each(trace, metrics).items() or {"": judge(trace, metrics)}.items():
        print_prose(f"{arm}: {verdict.line()}" if arm else verdict.line())
    print_prose(f"{ending.outcome.name.lower()} at {ending.t_s:.3f} s: {sentence}{detail}.")


@contextmanager
def show_progress(label: str, quiet: bool = False) -> Iterator[ProgressCall | None]:
    """Progress of simulated time: a bar on a terminal, else a line every few seconds; both on stderr."""
    if quiet:
        yield None
    elif sys.stderr.isatty():
        yield from _run_bar(label)
    else:
        yield _Lines(label)


_BAR = 16  # columns
_BESIDE = _BAR + len("   0:00:00")


class _Description(ProgressColumn):
    """What is going on, cut where there is no room for it beside the bar and its figures."""

    def render(self, task: Task) -> Text:
        """Its text for the width of the terminal."""
        text = Text(task.description, no_wrap=True)
        room = terminal_width(sys.stderr) - _BESIDE - len(task.fields["reached"])
        text.truncate(max(1, room), overflow="ellipsis")
        return text


@contextmanager
def _bar(label: str) -> Iterator[Callable[[float, float, str], None]]:
    """A bar; what is yielded takes how far it is, the whole, and the same in words.

    What has to be said meanwhile takes the place of the label and of the figures: it needs the room of both.
    """
    columns = (
        _Description(),
        BarColumn(_BAR),
        TextColumn("{task.fields[reached]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=None, reached="")

        def update(done: float, total: float, reached: str) -> None:
            bar.update(task, description=label, completed=done, total=total, reached=reached)

        with on_screen(lambda text: bar.update(task, description=text, reached="")):
            yield update


def _run_bar(label: str) -> Iterator[ProgressCall]:
    began = working_time()
    with _bar(label) as bar:

        def update(reached_s: float, duration_s: float) -> None:
            factor = f"{reached_s / max(working_time() - began, 1e-9):.1f}x real time"
            beside = factor if reached_s < duration_s else "metrics, files"
            bar(reached_s, duration_s, f"{reached_s:.1f}/{duration_s:.1f} s  {beside}")

        yield update


class _Lines:
    """A plain line of progress every five seconds."""

    def __init__(self, label: str) -> None:
        self._label = label
        self._began = self._last = working_time()

    def __call__(self, reached_s: float, duration_s: float) -> None:
        now = working_time()
        if now - self._last >= 5.0:
            self._last = now
            factor = reached_s / (now - self._began)
            text = f"{self._label}: {reached_s:.1f} of {duration_s:.1f} s, {factor:.1f}x real time"
            print(text, file=sys.stderr, flush=True)


@contextmanager
def show_batch_progress(label: str) -> Iterator[Callable[[int, int, str], None]]:
    """Progress of a batch with the time that remains: a bar on a terminal, else lines; both on stderr."""
    if sys.stderr.isatty():
        yield from _batch_bar(label)
    else:
        yield _BatchLines(label)


def _batch_bar(label: str) -> Iterator[Callable[[int, int, str], None]]:
    failed = 0
    with _bar(label) as bar:

        def update(done: int, total: int, outcome: str) -> None:
            nonlocal failed
            failed += outcome != "completed"
            bar(done, total, f"{done}/{total} runs" + (f"  {failed} failed" if failed else ""))

        yield update


@contextmanager
def show_count(label: str, noun: str, *, quiet: bool = False) -> Iterator[Callable[[int, int], None] | None]:
    """Progress of something that is counted: a bar on a terminal, else a line every five seconds."""
    if quiet:
        yield None
    elif sys.stderr.isatty():
        with _bar(label) as bar:
            yield lambda done, total: bar(done, total, f"{done}/{total} {noun}")
    else:
        last = time.perf_counter()

        def tell(done: int, total: int) -> None:
            nonlocal last
            if time.perf_counter() - last >= 5.0:
                last = time.perf_counter()
                print(f"{label}: {done} of {total} {noun}", file=sys.stderr, flush=True)

        yield tell


class _BatchLines:
    """A plain line every five seconds, and at the end."""

    def __init__(self, label: str) -> None:
        self._label = label
        self._began = self._last = time.perf_counter()
        self._first = -1
        self._failed = 0

    def __call__(self, done: int, total: int, outcome: str) -> None:
        now = time.perf_counter()
        if self._first < 0:
            self._first = done - 1
        self._failed += outcome != "completed"
        if now - self._last >= 5.0 or done == total:
            self._last = now
            left = (total - done) * (now - self._began) / max(done - self._first, 1)
            text = f"{self._label}: {done} of {total} runs, {self._failed} failed, about {left:.0f} s to go"
            print(text, file=sys.stderr, flush=True)


def print_leaderboard(metric: str, rows: "Sequence[LeaderboardRow]", points: int) -> None:
    """Print a leaderboard, failures beside every figure, and over how many points of a grid it pools them."""

    def interval(figure: "Interval") -> str:
        if figure.value is None:
            return "-"
        if figure.low is None or figure.high is None:
            return number(figure.value, 3)
        return f"{number(figure.value, 3)} [{number(figure.low, 3)}, {number(figure.high, 3)}]"

    from surgsim.metrics.catalog import METRICS

    def cells(row: "LeaderboardRow") -> tuple[str, ...]:
        place = str(row.place or "-")
        rank = number(row.rank.value, 3)
        return (row.controller, place, row.failed_words, str(row.runs), interval(row.value), rank)

    table = [cells(row) for row in rows]
    header = ("controller", "place", "failed", "runs", "IQM [95 %]", "mean rank")
    pooled = f", all {points} points of the grid pooled" if points > 1 else ""
    title = f"{METRICS[metric].heading}; who is not told apart shares a place{pooled}"
    print_table(title, header, table, right=(1, 3, 4, 5))
