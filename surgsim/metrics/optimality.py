"""How near the manipulability came to the largest that self-motion could have reached."""

import json
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from surgsim.control.self_motion import SelfMotion, SelfMotionPoint
from surgsim.metrics.metric import CHOICE, Metric, Undefined
from surgsim.models.arm import ArmModel
from surgsim.models.config import SceneConfig
from surgsim.trace.trace import Trace

Array = NDArray[np.float64]

SAMPLES = 10
_STARTS = 12
_COARSE_RAD = 1e-3
"""Where the metric's climbs end; mu is stationary there, so its relative error is about the square."""


def attainable_manipulability(
    trace: Trace, samples: int = SAMPLES, tolerance_rad: float = 1e-6
) -> tuple[Array, Array]:
    """Largest manipulability mu* that self-motion reaches at the tip positions of a run.

    At `samples` ticks spread over the run: tip and trocar where they were, joints inside their limits. The
    local optima that can be reached from the run's first configuration are sought once and then followed, and
    so is the one uphill of each tick's own configuration, by climbs that end at a step below `tolerance_rad`.

    Returns:
        Row numbers (samples,), and mu* there (samples,).
    """
    scene = _scene_of(trace)
    manifold = _manifold_of(scene)
    rows = np.unique(np.linspace(0, len(trace) - 1, samples).astype(int))
    has_trocar = trace.meta.scenario.get("trocar") is not None
    best = np.full(len(rows), np.nan)
    followed: list[SelfMotionPoint] = []
    for k, row in enumerate(rows):
        q, p_WT = trace.block("q")[row], trace.block("tip")[row]
        p_WC = trace.block("trocar")[row] if has_trocar else None
        if k == 0:
            here, points = _search(scene, _bytes(q), _bytes(p_WT), None if p_WC is None else _bytes(p_WC))
        else:
            here = manifold.project(q, p_WT, p_WC)
            starts = (*followed, here)
            points = tuple(manifold.climb(s.q, p_WT, p_WC, tolerance_rad=tolerance_rad) for s in starts)
        best[k] = max([here.mu, *(point.mu for point in points if manifold.inside(point))])
        followed = _distinct(points, manifold)
    return rows, best


def manipulability_optimality(trace: Trace) -> float:
    """Mean over time of mu / mu*; 1 is on the optimum throughout. mu* is interpolated between its samples.

    Raises:
        Undefined: If the arm is singular where self-motion is followed: it has no direction there.
    """
    try:
        rows, best = attainable_manipulability(trace, SAMPLES, _COARSE_RAD)
    except np.linalg.LinAlgError as error:
        raise Undefined("the arm is singular in this run: its self-motion cannot be followed") from error
    return float(np.mean(trace["manipulability"] / np.interp(np.arange(len(trace)), rows, best)))


def _distinct(points: Sequence[SelfMotionPoint], manifold: SelfMotion) -> list[SelfMotionPoint]:
    """Points inside the limits, one of each value of mu, the four largest."""
    kept: list[SelfMotionPoint] = []
    for point in sorted(points, key=lambda point: -point.mu):
        if manifold.inside(point) and all(abs(point.mu - other.mu) > 1e-6 for other in kept):
            kept.append(point)
    return kept[:4]


@lru_cache(maxsize=256)
def _search(
    scene: str, q: bytes, p_WT: bytes, p_WC: bytes | None
) -> tuple[SelfMotionPoint, tuple[SelfMotionPoint, ...]]:
    """The point of the manifold next to `q`, and the optima that can be reached from it.

    The runs of a batch that differ in seed, controller or disturbance share scene and start. This is a
    function of its arguments alone, so a run's metric does not depend on the runs before it.
    """
    manifold = _manifold_of(scene)
    tip, trocar = _array(p_WT), None if p_WC is None else _array(p_WC)
    here = manifold.project(_array(q), tip, trocar)
    return here, tuple(manifold.optima(here, tip, trocar, _STARTS))


def _bytes(a: Array) -> bytes:
    return np.ascontiguousarray(a, dtype=np.float64).tobytes()


def _array(content: bytes) -> Array:
    return np.frombuffer(content).copy()  # a read-only array would be compiled for anew


def _scene_of(trace: Trace) -> str:
    """What the nominal arm of a run is made of, as JSON."""
    scene = {key: trace.meta.scenario[key] for key in ("robot", "instrument", "trocar", "theatre")}
    return json.dumps(scene, sort_keys=True)


@lru_cache(maxsize=8)
def _manifold_of(scene: str) -> SelfMotion:
    return SelfMotion(ArmModel(SceneConfig.model_validate_json(scene)), margin_rad=0.0)


METRICS = (
    Metric(
        name="manipulability_optimality",
        heading="manipulability over the attainable, mean",
        matters=0.01,
        matters_source=CHOICE,
        meaning="mean of the manipulability over the largest that self-motion could reach",
        compute=manipulability_optimality,
        lower_is_better=False,
    ),
)
