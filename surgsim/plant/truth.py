"""Where things really are, for the trace: never shown to a controller."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.models.build import Scene

Array = NDArray[np.float64]
_NOWHERE = np.full(3, np.nan)


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """True points of instrument and port, world frame.

    Attributes:
        p_WT: Tip (3,) [m].
        p_WR: Wrist: the shaft's second point (3,) [m].
        p_WC: Trocar (3,) [m]; NaN without one.
    """

    p_WT: Array
    p_WR: Array
    p_WC: Array


def arm_view(values: Array, ids: NDArray[np.intp]) -> Array:
    """The arm's part of one of MuJoCo's vectors, not copied; its seven entries follow each other."""
    first = int(ids[0])
    if not np.array_equal(ids, np.arange(first, first + len(ids))):
        raise ValueError(f"the arm's entries {ids} do not follow each other")
    return values[first : first + len(ids)]


class TruthReader:
    """Copies the points out of MuJoCo's data."""

    def __init__(self, scene: Scene, data: mujoco.MjData) -> None:
        self._points = data.site_xpos
        self._has_trocar = scene.trocar_site is not None
        trocar = scene.tip_site if scene.trocar_site is None else scene.trocar_site
        self._sites = np.array([scene.tip_site, scene.shaft_entry_site, trocar])

    def read(self) -> Truth:
        """The points as they are now."""
        p_WT, p_WR, p_WC = self._points[self._sites]
        return Truth(p_WT=p_WT, p_WR=p_WR, p_WC=p_WC if self._has_trocar else _NOWHERE)
