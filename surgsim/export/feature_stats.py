"""What LeRobot wants to know of a feature: extremes, mean, standard deviation, quantiles, how many."""

from collections.abc import Sequence

import numpy as np

from surgsim.array import Array
from surgsim.models.drawing import Picture

Stats = dict[str, Array]

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_LEVELS = 256


def vector_stats(values: Array) -> Stats:
    """Of values (frames, width), each statistic (width,); `count` (1,)."""
    found: Stats = {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
        "count": np.array([len(values)]),
    }
    return found | {name: np.quantile(values, share, axis=0) for name, share in QUANTILES.items()}


class PictureStats:
    """The same of pictures, each statistic (3, 1, 1) of the channels, from 0 to 1."""

    def __init__(self) -> None:
        self._counts = np.zeros((3, _LEVELS))
        self._pictures = 0

    def add(self, picture: Picture) -> None:
        """Count the levels of a picture (height, width, 3)."""
        for channel in range(3):
            self._counts[channel] += np.bincount(picture[..., channel].ravel(), minlength=_LEVELS)
        self._pictures += 1

    def __add__(self, other: "PictureStats") -> "PictureStats":
        found = PictureStats()
        found._counts = self._counts + other._counts
        found._pictures = self._pictures + other._pictures
        return found

    def stats(self) -> Stats:
        """The statistics."""
        levels = np.arange(_LEVELS) / (_LEVELS - 1)
        share = self._counts / self._counts.sum(axis=1, keepdims=True)
        mean = share @ levels
        found: Stats = {
            "min": _channels([levels[row > 0.0][0] for row in share]),
            "max": _channels([levels[row > 0.0][-1] for row in share]),
            "mean": _channels(mean),
            "std": _channels(np.sqrt(np.maximum(share @ levels**2 - mean**2, 0.0))),
            "count": np.array([self._pictures]),
        }
        below = np.cumsum(share, axis=1)
        for name, wanted in QUANTILES.items():
            found[name] = _channels([levels[int(np.searchsorted(row, wanted - 1e-12))] for row in below])
        return found


def _channels(values: Sequence[float] | Array) -> Array:
    return np.array(values, dtype=np.float64).reshape(3, 1, 1)
