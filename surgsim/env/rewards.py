"""Rewards from the errors that the metrics are made of."""

import numpy as np

from surgsim.metrics.accuracy import CONVERGED_RCM_M, CONVERGED_TIP_M
from surgsim.plant.truth import Truth
from surgsim.spatial import shaft_distance
from surgsim.tasks.base import TipCommand


def errors(truth: Truth, command: TipCommand, has_trocar: bool) -> tuple[float, float | None]:
    """Tip and RCM error [m], as the trace defines them; no RCM error without a trocar."""
    tip = float(np.linalg.norm(truth.p_WT - command.p_WTd))
    return tip, float(shaft_distance(truth.p_WC, truth.p_WS, truth.p_WR)) if has_trocar else None


def reward(tip_error_m: float, rcm_error_m: float | None) -> float:
    """In [0, 1]: 1 without error, 1/2 where both errors are at the limits of `convergence_time_s`.

    r = 1/2 / (1 + e_tip / 1 mm) + 1/2 / (1 + e_rcm / 5 mm), and 1 / (1 + e_tip / 1 mm) without a trocar.
    """
    tip = _score(tip_error_m, CONVERGED_TIP_M)
    return tip if rcm_error_m is None else 0.5 * (tip + _score(rcm_error_m, CONVERGED_RCM_M))


def _score(error_m: float, half_m: float) -> float:
    return 1.0 / (1.0 + error_m / half_m) if np.isfinite(error_m) else 0.0
