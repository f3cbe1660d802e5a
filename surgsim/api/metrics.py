"""The metrics of a run as a mapping that helps with names and shows itself."""

from collections.abc import Iterator, Mapping

from surgsim.display import html_table, number, text_table
from surgsim.errors import not_held
from surgsim.metrics.catalog import METRICS
from surgsim.metrics.metric import Metric

_RIGHT = (1,)


class Metrics(Mapping[str, float | None]):
    """Metrics by name; None where the run does not define one.

    Example:
        >>> from surgsim.api.metrics import Metrics
        >>> Metrics({"tip_error_rms_mm": 0.0449, "trocar_force_max_n": None})
        metric              value
        tip_error_rms_mm  0.04490
    """

    def __init__(self, values: Mapping[str, float | None]) -> None:
        self._values = dict(values)

    def __getitem__(self, name: str) -> float | None:
        try:
            return self._values[name]
        except (KeyError, TypeError):  # TypeError: not hashable
            raise not_held(name, "metric of this run", self._values, "list(run.metrics)") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def defined(self) -> dict[str, float]:
        """Those that the run defines."""
        return {name: value for name, value in self._values.items() if value is not None}

    def __repr__(self) -> str:
        rows = [(name, shown) for name, shown, _ in self._rows()]
        return text_table(("metric", "value"), rows, _RIGHT) if rows else "no metrics"

    def _repr_html_(self) -> str:
        return html_table(("metric", "value", "meaning"), self._rows(), _RIGHT)

    def _rows(self) -> list[tuple[str, str, str]]:
        rows = []
        for name, value in self.defined().items():
            known = METRICS.get(name) or _of_an_arm(name)
            rows.append((name, number(value, known.digits if known else 4), known.meaning if known else ""))
        return rows


def _of_an_arm(name: str) -> Metric | None:
    """The metric whose name follows that of an arm, the longest such."""
    ends = [metric for metric in METRICS.values() if name.endswith(f"_{metric.name}")]
    return max(ends, key=lambda metric: len(metric.name), default=None)
