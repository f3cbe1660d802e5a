"""How near the manipulability came to the largest that self-motion could have reached."""

import json
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from surgsim.control.self_motion import SelfMotion, SelfMotionPoint
from surgsim.metrics.metric import Metric
from surgsim.models.arm import ArmModel
from surgsim.models.config import SceneConfig
from surgsim.trace.trace import Trace

Array = NDArray[np.float64]

SAMPLES = 20
_STARTS = 12


def attainable_manipulability(trace: Trace, samples: int = SAMPLES) -> tuple[Array, Array]:
    """Largest manipulability mu* that self-motion reaches at the tip positions of a run.

    At `samples` ticks spread over the run: tip and trocar where they were, joints inside their limits. The
    local optima that can be reached from the run's first configuration are sought once and then followed, and
    so is the one uphill of each tick's own configuration.

    Returns:
        Row numbers (samples,), and mu* there (samples,).
    """
    manifold = SelfMotion(_arm(trace), margin_rad=0.0)
    rows = np.unique(np.linspace(0, len(trace) - 1, samples).astype(int))
    has_trocar = trace.meta.scenario.get("trocar") is not None
    best = np.full(len(rows), np.nan)
    followed: list[SelfMotionPoint] = []
    for k, row in enumerate(rows):
        p_WT = trace.block("tip")[row]
        p_WC = trace.block("trocar")[row] if has_trocar else None
        here = manifold.project(trace.block("q")[row], p_WT, p_WC)
        if k == 0:
            followed = manifold.optima(here, p_WT, p_WC, _STARTS)
        else:
            followed = [manifold.climb(point.q, p_WT, p_WC) for point in followed]
        uphill = manifold.climb(here.q, p_WT, p_WC)
        found = [point.mu for point in (*followed, uphill) if manifold.inside(point)]
        best[k] = max([here.mu, *found])
        followed = _distinct([*followed, uphill], manifold)
    return rows, best


def manipulability_optimality(trace: Trace) -> float:
    """Mean over time of mu / mu*, sampled; 1 is on the optimum throughout."""
    rows, best = attainable_manipulability(trace)
    return float(np.mean(trace["manipulability"][rows] / best))


def _distinct(points: list[SelfMotionPoint], manifold: SelfMotion) -> list[SelfMotionPoint]:
    """Points inside the limits, one of each value of mu, the four largest."""
    kept: list[SelfMotionPoint] = []
    for point in sorted(points, key=lambda point: -point.mu):
        if manifold.inside(point) and all(abs(point.mu - other.mu) > 1e-6 for other in kept):
            kept.append(point)
    return kept[:4]


def _arm(trace: Trace) -> ArmModel:
    """The nominal arm of a run; the runs of a batch, which differ in seed and controller, share it."""
    scene = {key: trace.meta.scenario[key] for key in ("robot", "instrument", "trocar", "theatre")}
    return _arm_of(json.dumps(scene, sort_keys=True))


@lru_cache(maxsize=8)
def _arm_of(scene_json: str) -> ArmModel:
    return ArmModel(SceneConfig.model_validate_json(scene_json))


METRICS = (
    Metric(
        name="manipulability_optimality",
        meaning="mean of the manipulability over the largest that self-motion could reach",
        compute=manipulability_optimality,
        lower_is_better=False,
    ),
)
