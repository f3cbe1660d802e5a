"""Measures of a trace that a study may take, and random starts whose convergence is measured."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surgsim.control.rcm import rcm_kinematics
from surgsim.simulate.setup import Setup
from surgsim.studies.study import Array
from surgsim.trace.trace import Trace


def outcome(trace: Trace) -> str:
    """How the run ended."""
    return trace.meta.ending.outcome.name.lower()


def within_from_s(t: Array, error: NDArray[np.floating[Any]], threshold: float) -> float | None:
    """Time from which `error` stays at or below `threshold`; None if it does not."""
    late = np.flatnonzero(~(error <= threshold))
    if late.size == 0:
        return 0.0
    last = int(late[-1])
    return float(t[last + 1]) if last + 1 < len(t) else None


def decay_rate(t: Array, error: Array, share: float) -> float | None:
    """Rate [1/s] of the exponential that reaches `share` of its start when `error` does; None if never."""
    time = within_from_s(t, error, share * float(error[0]))
    return math.log(1.0 / share) / time if time else None


class Spread(NamedTuple):
    """How far random starts are off.

    The standard deviation of the joints' displacement [rad], and smallest and largest distance [mm] of the
    tip from the path's start and of the shaft from the trocar.
    """

    deviation_rad: float
    tip_mm: tuple[float, float]
    rcm_mm: tuple[float, float]

    def draw(self, setup: Setup, seed: int) -> Array:
        """Joint positions (n,) [rad] inside the limits whose tip and shaft are displaced that far."""
        rng, limits = np.random.default_rng(seed), setup.arm.limits
        here, p_WC = setup.arm.kinematics(setup.q_start).p_WT, setup.plant.reset(setup.q_start).p_WC
        while True:
            q = setup.q_start + self.deviation_rad * rng.standard_normal(setup.q_start.size)
            kin = setup.arm.kinematics(q)
            tip = 1e3 * float(np.linalg.norm(kin.p_WT - here))
            rcm = 1e3 * float(np.linalg.norm(rcm_kinematics(kin, p_WC, np.zeros(3)).error))
            inside = bool((q > limits.q_min).all() and (q < limits.q_max).all())
            if inside and _between(tip, self.tip_mm) and _between(rcm, self.rcm_mm):
                return q


def _between(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= value <= bounds[1]
