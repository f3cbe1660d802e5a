"""How errors of an arm's geometry move its instrument, to first order.

The errors are small displacements of frames, T_k -> T_k exp(x_k), and offsets of the joints, so that

    T_WT = T_WN exp(H(q) x),   blocks of H: Ad(T_WN^-1 T_Wk),   Ad(T) (d, f) = (R d + p x R f, R f)

with the nominal tip N. In order: the base (6), the place of each joint in the link before it (6 n), the
joints' offsets (n), the instrument about its shaft's entry, in the tip's axes (6). Each six are linear [m]
before angular [rad]. They are the errors of the disturbance `calibration_error`. What they can do is less
than their number: an offset also turns a link, and base and instrument reach what the links do at the ends.
"""

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.algebra import cross
from surgsim.tick.arrays import Model
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.views import doubles, vector


def parameters(n: int) -> int:
    """How many parameters the geometry of an arm of n joints has."""
    return 7 * n + 12


@compiled
def fill_columns(model: Model, bodies: Array, p_TA: Array, back_m: float, H: Array) -> None:
    """Fill H (6, 7 n + 12), rows in the axes of the nominal tip: motion of a point behind the tip, and turn.

    Args:
        model: After `surgsim.tick.nominal.place`.
        bodies: Numbers of the base and of the body before each joint (1 + n,).
        p_TA: The shaft's entry in the nominal tip's frame (3,) [m].
        back_m: Distance of the point from the tip, along the shaft [m].
        H: Filled.
    """
    n, turn = bodies.size - 1, doubles(model.site_xmat, 3, 3)
    tip = vector(model.site_xpos, 3)
    places, turns = doubles(model.xpos, model.nbody, 3), doubles(model.xmat, model.nbody, 9)
    axes, anchors = doubles(model.xaxis, n, 3), doubles(model.xanchor, n, 3)
    point, identity = scratch(3), scratch(9)
    for i in range(9):
        identity[i] = 1.0 if i % 4 == 0 else 0.0
    for i in range(3):
        point[i] = tip[i] - back_m * turn[i, 2]
    base = int(bodies[0])
    _fill_frame(turn, point, turns[base], places[base], H[:, :6])
    for k in range(n):
        before = turns[int(bodies[1 + k])]
        _fill_frame(turn, point, before, anchors[k], H[:, 6 + 6 * k : 12 + 6 * k])
        _fill_turn(turn, point, axes[k], anchors[k], H, 6 + 6 * n + k)
    for i in range(3):
        point[i] = 0.0
    entry = scratch(3)
    entry[0], entry[1], entry[2] = p_TA[0], p_TA[1], back_m + p_TA[2]
    _fill_frame(identity.reshape((3, 3)), point, identity, entry, H[:, 6 + 7 * n :])


@compiled
def _fill_frame(turn: Array, point: Array, axes: Array, place: Array, H: Array) -> None:
    """Columns (6, 6) of the displacement of a frame with these axes (9,) at this place (3,) [m]."""
    axis, own = scratch(3), scratch_matrix(3, 3)
    for j in range(3):
        for i in range(3):
            s = 0.0
            for k in range(3):
                s += turn[k, i] * axes[3 * k + j]
            own[i, j] = s
            axis[i] = axes[3 * i + j]
        _fill_turn(turn, point, axis, place, H, 3 + j)
        for i in range(3):
            H[i, j], H[3 + i, j] = own[i, j], 0.0


@compiled
def _fill_turn(turn: Array, point: Array, axis: Array, place: Array, H: Array, column: int) -> None:
    """Column of a turn about an axis (3,) through a place (3,) [m]."""
    lever, moved = scratch(3), scratch(3)
    for i in range(3):
        lever[i] = point[i] - place[i]
    cross(axis, lever, moved)
    for i in range(3):
        linear = angular = 0.0
        for k in range(3):
            linear += turn[k, i] * moved[k]
            angular += turn[k, i] * axis[k]
        H[i, column], H[3 + i, column] = linear, angular
