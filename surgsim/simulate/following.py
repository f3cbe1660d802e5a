"""Kernels of a path through the port, followed from a start by least joint motion, and the room that is left.

The room of a joint on a path is its distance from the nearer end of its range, the smallest at any place.
The room of the path is the smallest of any joint. It is negative where a joint passes its range, so that a
start outside can be improved like one inside. A joint may be turned by whole turns: what counts is the turn
with the most room.
"""

import math
from typing import NamedTuple

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.manifold import Manifold, fill_constraints
from surgsim.plant.contacts import NOTHING, Watch, forbidden_contact
from surgsim.tick.algebra import back_substitute, dot, factor, nearest, norm
from surgsim.tick.arrays import Model
from surgsim.tick.nominal import kinematics
from surgsim.tick.scratch import scratch, scratch_matrix

REACHED_M = 1e-4
"""What tip and shaft may lack at a place of a path, as one norm [m]."""
LOST, TOUCHES = -100.0, -10.0
"""Added to the worth of a start: its path is not followed to the end, or something touches on it."""
_SETTLED_M = 1e-10
_STEPS = 30
_LONGEST_RAD = 0.5
_DAMPING, _LEAST_DAMPING = 0.1, 1e-10
_MEAN_SHARE = 0.01
_TURN = 2.0 * math.pi


class Path(NamedTuple):
    """Places of the tip, in order, and the joint limits.

    Attributes:
        places: (k, 3) [m].
        low: Lowest joint positions (n,) [rad].
        high: Highest joint positions (n,) [rad].
        joints: Joints whose room counts, from the base on: all, or all but one that only rolls the shaft.
        clearance_m: Distance that arm, patient and table must keep [m]; negative: contact does not count.
    """

    places: Array
    low: Array
    high: Array
    joints: int
    clearance_m: float


@compiled
def settle(model: Model, on: Manifold, q: Array) -> float:
    """Q (n,) becomes a point of the manifold near it, from `on.low` to `on.high`; the norm of what lacks [m].

    Damped Gauss-Newton steps of least motion, q -= J_f^T (J_f J_f^T + (l0 |r|^2 + l1) I)^-1 r, at most half a
    radian long. J_f has the columns of the joints that are free: one at its bound that would pass it is not.
    `model` is evaluated at q.
    """
    m, n = on.rows, q.size
    J, r, step = scratch_matrix(m, n), scratch(m), scratch(n)
    kinematics(model, q)
    fill_constraints(model, on, J, r)
    for _ in range(_STEPS):
        if dot(r, r) < _SETTLED_M * _SETTLED_M or not _fill_step(on, q, J, r, step):
            break
        shorter = min(1.0, _LONGEST_RAD / max(norm(step), 1e-12))
        for j in range(n):
            q[j] = min(max(q[j] + shorter * step[j], on.low[j]), on.high[j])
        kinematics(model, q)
        fill_constraints(model, on, J, r)
    return norm(r)


@compiled
def _fill_step(on: Manifold, q: Array, J: Array, r: Array, step: Array) -> bool:
    """The step of `settle`; False if it is not defined."""
    m, n = on.rows, q.size
    A, y, held = scratch_matrix(m, m), scratch(m), scratch(n)
    held[:] = 0.0
    damping = _DAMPING * dot(r, r) + _LEAST_DAMPING
    for _ in range(n):
        for i in range(m):
            y[i] = r[i]
            for k in range(m):
                s = damping if i == k else 0.0
                for j in range(n):
                    s += (1.0 - held[j]) * J[i, j] * J[k, j]
                A[i, k] = s
        if not factor(A):
            return False
        back_substitute(A, y)
        again = False
        for j in range(n):
            s = 0.0
            for i in range(m):
                s -= J[i, j] * y[i]
            step[j] = (1.0 - held[j]) * s
            blocked = (q[j] <= on.low[j] and step[j] < 0.0) or (q[j] >= on.high[j] and step[j] > 0.0)
            if blocked:
                held[j], step[j], again = 1.0, 0.0, True
        if not again:
            break
    return True


@compiled
def follow(
    model: Model, on: Manifold, watch: Watch, path: Path, q: Array, enough: float
) -> tuple[int, float, float, float]:
    """Move q (n,), a point of the first place, along the path.

    Ends early at a place that is not reached, and where the path's worth falls below `enough` [rad].

    Returns:
        How many places were reached, what lacks at the last one tried [m], the room [rad], and the worth: the
        room and a hundredth of the joints' mean room, which tells starts apart where one joint has the same
        room in all of them.
    """
    n = q.size
    lowest, highest = q.copy(), q.copy()
    room = value = math.inf
    miss = touches = 0.0
    for i in range(path.places.shape[0]):
        for k in range(3):
            on.p_WT[k] = path.places[i, k]
        miss = settle(model, on, q)
        if not miss < REACHED_M:
            return i, miss, room, LOST + i / path.places.shape[0] - min(miss, 1.0)
        for j in range(n):
            lowest[j], highest[j] = min(lowest[j], q[j]), max(highest[j], q[j])
        room, mean = _room(path, lowest, highest)
        if path.clearance_m >= 0.0 and touches == 0.0:
            _, other, _, left = forbidden_contact(watch, on.p_WC)
            if other != NOTHING or left < path.clearance_m:
                touches = TOUCHES
        value = room + _MEAN_SHARE * mean + touches
        if value < enough:
            return i + 1, miss, room, value
    return path.places.shape[0], miss, room, value


@compiled
def _room(path: Path, lowest: Array, highest: Array) -> tuple[float, float]:
    """Smallest and mean room of the joints on their way from lowest to highest (n,) [rad]."""
    room, total = math.inf, 0.0
    for j in range(path.joints):
        shift = _TURN * whole_turns(path, j, 0.5 * (lowest[j] + highest[j]))
        left = min(lowest[j] + shift - path.low[j], path.high[j] - highest[j] - shift)
        room, total = min(room, left), total + left
    return room, total / path.joints


@compiled
def whole_turns(path: Path, j: int, q: float) -> float:
    """By how many turns joint j at `q` [rad] comes nearest to the middle of its range."""
    return float(math.floor((0.5 * (path.low[j] + path.high[j]) - q) / _TURN + 0.5))


@compiled
def move(
    model: Model, on: Manifold, path: Path, q: Array, direction: Array, length: float, out: Array
) -> bool:
    """`out` (n,): the start that lies `length` [rad] away from q along `direction`, tip and shaft held.

    False where there is no way in this direction, or it leads off.
    """
    m, n = on.rows, q.size
    J, r, way = scratch_matrix(m, n), scratch(m), scratch(n)
    for k in range(3):
        on.p_WT[k] = path.places[0, k]
    kinematics(model, q)
    fill_constraints(model, on, J, r)
    r[:] = 0.0
    for j in range(n):
        way[j] = direction[j]
    if not nearest(J, r, way, way):
        return False
    size = norm(way)
    if size < 1e-6:
        return False
    for j in range(n):
        out[j] = min(max(q[j] + length * way[j] / size, on.low[j]), on.high[j])
    return settle(model, on, out) < _SETTLED_M * 10.0


@compiled
def improve_start(
    model: Model,
    on: Manifold,
    watch: Watch,
    path: Path,
    q: Array,
    value: float,
    directions: Array,
    length: float,
    shortest: float,
    most: int,
) -> None:
    """Q (n,), worth `value`, becomes the start of largest worth around it.

    A pattern search in the self-motion: steps along the directions (k, n) in turn, both ways, while they pay;
    the length is halved when none has, until it is below `shortest` [rad], or `most` steps were tried.
    """
    count = directions.shape[0]
    trial, end, failed, at, tried = np.empty(q.size), np.empty(q.size), 0, 0, 0
    while count > 0 and length >= shortest and tried < most:
        better = False
        for sign in (1.0, -1.0):
            while tried < most and move(model, on, path, q, directions[at], sign * length, trial):
                tried += 1
                end[:] = trial
                found = follow(model, on, watch, path, end, value)[3]
                if not found > value:
                    break
                q[:], value, better = trial, found, True
            if better:
                break
        at = (at + 1) % count
        failed = 0 if better else failed + 1
        if failed >= count:
            length, failed = 0.5 * length, 0
