"""A leaderboard as Python sees it."""

from collections.abc import Sequence
from typing import overload

from surgsim.compare.intervals import Interval
from surgsim.compare.leaderboard import LeaderboardRow
from surgsim.display import html_table, html_title, number, text_table
from surgsim.metrics.catalog import METRICS

_HEADER = ("controller", "runs", "failed", "value", "95 % interval", "mean rank")
_RIGHT = (1, 2, 3, 4, 5)


class Leaderboard(Sequence[LeaderboardRow]):
    """Rows of controllers by one metric, the best mean rank first.

    Args:
        metric: The metric's name.
        rows: The rows in order.

    Example:
        >>> import surgsim
        >>> found = surgsim.compare("circle_lwr4plus", controllers=["pinv", "qp"], task={"duration_s": 2.0})
        >>> best = found.leaderboard("tip_error_rms_mm")[0]
        >>> best.controller, best.failed
        ('pinv', 0)
    """

    def __init__(self, metric: str, rows: Sequence[LeaderboardRow]) -> None:
        self.metric = metric
        self._rows = tuple(rows)

    @overload
    def __getitem__(self, place: int) -> LeaderboardRow: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[LeaderboardRow, ...]: ...
    def __getitem__(self, place: int | slice) -> LeaderboardRow | tuple[LeaderboardRow, ...]:
        return self._rows[place]

    def __len__(self) -> int:
        return len(self._rows)

    def __repr__(self) -> str:
        return f"{self._title}\n{text_table(_HEADER, self._cells(), _RIGHT)}"

    def _repr_html_(self) -> str:
        return html_title(self._title) + html_table(_HEADER, self._cells(), _RIGHT)

    @property
    def _title(self) -> str:
        return f"{self.metric}, interquartile mean of completed runs, best mean rank first"

    def _cells(self) -> list[tuple[str, ...]]:
        digits = METRICS[self.metric].digits
        return [
            (
                row.controller,
                str(row.runs),
                str(row.failed),
                number(row.value.value, digits),
                _interval(row.value, digits),
                number(row.rank.value, 3),
            )
            for row in self._rows
        ]


def _interval(figure: Interval, digits: int) -> str:
    if figure.low is None or figure.high is None:
        return "-"
    return f"{number(figure.low, digits)} to {number(figure.high, digits)}"
