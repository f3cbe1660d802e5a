"""A task and a metric of a laboratory: a Lissajous figure, and how far the tip is off in the last second."""

import math
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import PositiveFloat

from surgsim.metrics.metric import Metric
from surgsim.tasks.base import Array, PathTaskConfig, following
from surgsim.trace.trace import Trace


def lissajous_path(numbers: Array, s: float, rows: Array) -> None:
    """Rows point and derivatives (3, 3), in the path's axes, at s from 0 to 1.

    p(s) = (A sin(2 pi s), B sin(4 pi s), 0). Without `@compiled` before it, it runs as Python; with it,
    compiled, to the same bits.
    """
    a, b = numbers[0], numbers[1]
    u, w = 2.0 * math.pi, 4.0 * math.pi
    rows[:] = 0.0
    rows[0, 0], rows[0, 1] = a * math.sin(u * s), b * math.sin(w * s)
    rows[1, 0], rows[1, 1] = a * u * math.cos(u * s), b * w * math.cos(w * s)
    rows[2, 0], rows[2, 1] = -a * u * u * math.sin(u * s), -b * w * w * math.sin(w * s)


class LissajousConfig(PathTaskConfig):
    """A figure of eight in the plane of the path's first two axes.

    Attributes:
        width_m: Half of its width, along the first axis [m].
        height_m: Half of its height, along the second [m].
    """

    kernel: ClassVar[Any] = staticmethod(following(lissajous_path))

    type: Literal["lissajous"] = "lissajous"
    width_m: PositiveFloat = 0.015
    height_m: PositiveFloat = 0.01

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers of the path."""
        return (self.width_m, self.height_m)


def tip_error_late_mm(trace: Trace) -> float:
    """Root mean square of the tip error over the last second [mm]."""
    ticks = round(1.0 / trace.meta.control_period_s)
    return float(1e3 * np.sqrt(np.mean(trace["tip_error_m"][-ticks:] ** 2)))


TIP_ERROR_LATE = Metric(
    name="tip_error_late_mm",
    heading="tip error in the last second, RMS [mm]",
    meaning="root mean square of the tip error over the last second",
    compute=tip_error_late_mm,
)
