"""How near the manipulability came to the largest that self-motion could have reached."""

import json
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from pydantic import ValidationError

from surgsim.array import Array
from surgsim.control.self_motion import SelfMotion, SelfMotionPoint
from surgsim.metrics.metric import CHOICE, Metric, Undefined
from surgsim.models.arm import ArmModel
from surgsim.models.config import SceneConfig
from surgsim.spatial import nearest_on_line
from surgsim.trace.trace import Trace

SAMPLES = 10
"""At how many ticks of a run mu* is sought at least."""
_MOST_SAMPLES, _WAY_M = 30, 0.02
_SHORTEST_LEVER_M = 0.02
_STARTS = 12
_COARSE_RAD = 1e-3
"""Where the metric's climbs end; mu is stationary there, so its relative error is about the square."""


def attainable_manipulability(
    trace: Trace, samples: int = SAMPLES, tolerance_rad: float = 1e-6
) -> tuple[Array, Array]:
    """Largest manipulability mu* that self-motion reaches at the tip positions of a run.

    At `samples` ticks spread over the run: the tip where it was, joints inside their limits, and the shaft
    held through its own point nearest to the trocar. That is the trocar itself where there is no RCM error;
    where there is one, the run's configuration is among those compared, and mu is never above mu*. Ticks with
    the tip in the port are left out: tip and port are then one point, which does not say how the shaft turns.

    The local optima that can be reached from the run's first configuration are sought once and then followed,
    and so is the one uphill of each tick's own configuration, by climbs that end at a step below
    `tolerance_rad`.

    Returns:
        Row numbers (at most samples,), and mu* there.
    """
    scene = _scene_of(trace)
    manifold = _manifold_of(scene)
    centres = _centres(trace)
    rows = np.unique(np.linspace(0, len(trace) - 1, samples).astype(int))
    if centres is not None:
        lever = np.linalg.norm(centres - trace.block("tip"), axis=1)
        rows = rows[lever[rows] > _SHORTEST_LEVER_M]
    best = np.full(len(rows), np.nan)
    followed: list[SelfMotionPoint] = []
    for k, row in enumerate(rows):
        q, p_WT = trace.block("q")[row], trace.block("tip")[row]
        p_WC = None if centres is None else centres[row]
        if k == 0:
            points = _search(scene, _bytes(q), _bytes(p_WT), None if p_WC is None else _bytes(p_WC))
        else:
            here = manifold.project(q, p_WT, p_WC)
            starts = (*followed, here)
            points = tuple(manifold.climb(s.q, p_WT, p_WC, tolerance_rad=tolerance_rad) for s in starts)
        best[k] = max(
            [float(trace["manipulability"][row]), *(point.mu for point in points if manifold.inside(point))]
        )
        followed = _distinct(points, manifold)
    return rows, best


def manipulability_optimality(trace: Trace) -> float:
    """Mean over time of mu / mu*; 1 is on the optimum throughout.

    The ratio is taken where mu* is known and interpolated between. A tip that moves on between two samples
    takes mu and mu* with it: mu over an interpolated mu* can be above 1, their own ratio cannot.

    Raises:
        Undefined: If the arm is singular where self-motion is followed: it has no direction there. Or if the
            tip is in the port all along.
    """
    try:
        rows, best = attainable_manipulability(trace, samples_of(trace), _COARSE_RAD)
    except np.linalg.LinAlgError as error:
        raise Undefined("the arm is singular in this run: its self-motion cannot be followed") from error
    if not rows.size:
        raise Undefined("the tip is in the port all along: nothing says how the shaft is turned")
    share = trace["manipulability"][rows] / best
    return float(np.mean(np.interp(np.arange(len(trace)), rows, share)))


def samples_of(trace: Trace) -> int:
    """At how many ticks mu* is sought: more for a longer way of the tip, within bounds."""
    way_m = float(np.sum(np.linalg.norm(np.diff(trace.block("tip"), axis=0), axis=1)))
    return int(np.clip(np.ceil(way_m / _WAY_M), SAMPLES, _MOST_SAMPLES))


def _centres(trace: Trace) -> Array | None:
    """The shaft's points nearest to the trocar (rows, 3) [m]; None without a trocar."""
    if trace.meta.scenario.get("trocar") is None:
        return None
    return nearest_on_line(trace.block("trocar"), trace.block("wrist"), trace.block("tip"))


def _distinct(points: Sequence[SelfMotionPoint], manifold: SelfMotion) -> list[SelfMotionPoint]:
    """Points inside the limits, one of each value of mu, the four largest."""
    kept: list[SelfMotionPoint] = []
    for point in sorted(points, key=lambda point: -point.mu):
        if manifold.inside(point) and all(abs(point.mu - other.mu) > 1e-6 for other in kept):
            kept.append(point)
    return kept[:4]


@lru_cache(maxsize=256)
def _search(scene: str, q: bytes, p_WT: bytes, p_WC: bytes | None) -> tuple[SelfMotionPoint, ...]:
    """The optima that can be reached from the point of the manifold next to `q`.

    The runs of a batch that differ in seed, controller or disturbance share scene and start. This is a
    function of its arguments alone, so a run's metric does not depend on the runs before it.
    """
    manifold = _manifold_of(scene)
    tip, trocar = _array(p_WT), None if p_WC is None else _array(p_WC)
    here = manifold.project(_array(q), tip, trocar)
    return tuple(manifold.optima(here, tip, trocar, _STARTS))


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
    try:
        config = SceneConfig.model_validate_json(scene)
    except ValidationError as error:  # of an arm whose files are not here, or are others by now
        raise Undefined("; ".join(problem["msg"] for problem in error.errors())) from error
    return SelfMotion(ArmModel(config), margin_rad=0.0)


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
