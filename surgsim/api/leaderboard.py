"""A leaderboard as Python sees it."""

from collections.abc import Sequence
from textwrap import fill
from typing import overload

from surgsim.compare.intervals import Interval
from surgsim.compare.leaderboard import LeaderboardRow
from surgsim.display import WIDTH, html_table, html_title, number, text_table

_HEADER = ("place", "controller", "done", "value", "95 % interval")
_RIGHT = (0, 2, 3, 4)
_DIGITS = 3


class Leaderboard(Sequence[LeaderboardRow]):
    """Rows of controllers by one metric, the best mean rank first.

    Args:
        metric: The metric's name.
        rows: The rows in order.
        sentence: Who wins, by how much and how sure.

    Example:
        >>> import surgsim
        >>> found = surgsim.compare("circle_lwr4plus", controllers=["pinv", "qp"], task={"duration_s": 2.0})
        >>> best = found.leaderboard("tip_error_rms_mm")[0]
        >>> best.controller, best.failed
        ('pinv', 0)
    """

    def __init__(self, metric: str, rows: Sequence[LeaderboardRow], sentence: str) -> None:
        self.metric = metric
        self.sentence = sentence
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
        said = fill(self.sentence, WIDTH, break_long_words=False)
        return f"{said}\n\n{text_table(_HEADER, self._cells(), _RIGHT)}\n{self._note}"

    def _repr_html_(self) -> str:
        return html_title(self.metric, self.sentence, self._note) + html_table(_HEADER, self._cells(), _RIGHT)

    @property
    def _note(self) -> str:
        return (
            "Done: runs that completed and did their task. Equal places are not told apart.\n"
            f"Value: {self.metric}, interquartile mean of completed runs."
        )

    def _cells(self) -> list[tuple[str, ...]]:
        return [
            (
                "-" if row.place is None else str(row.place),
                row.controller,
                f"{row.completed - row.not_done} of {row.runs}",
                number(row.value.value, _DIGITS),
                _interval(row.value),
            )
            for row in self._rows
        ]


def _interval(figure: Interval) -> str:
    if figure.low is None or figure.high is None:
        return "-"
    return f"{number(figure.low, _DIGITS)} to {number(figure.high, _DIGITS)}"
