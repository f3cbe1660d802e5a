"""The tip's motion as energy: its inertia with the RCM held, and a valve on what drives it."""

import math

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.teleop.tank import affordable
from surgsim.tick.algebra import back_substitute_rows, dot, factor, norm, outer_product, times
from surgsim.tick.arrays import Seen
from surgsim.tick.scratch import scratch, scratch_matrix

MARGIN = 1.1
"""What the inertia is taken for, over the model's: 10 % too little would cost the budget 11 % of itself."""
BRAKE_PER_S = 100.0
"""Rate at which motion that no energy covers is braked, at most [1/s]."""


@compiled
def fill_held_inertia(A: Array, out: Array) -> None:
    """Inertia of the tip with the further rows held (3, 3) [kg]: the tip's block of (J M^-1 J^T)^-1.

    Args:
        A: Cholesky factor of J M^-1 J^T (m, m), the tip's rows first.
        out: Filled.
    """
    inverse = scratch_matrix(A.shape[0], A.shape[0])
    inverse[:] = 0.0
    for i in range(A.shape[0]):
        inverse[i, i] = 1.0
    back_substitute_rows(A, inverse)
    out[:] = inverse[:3, :3]


@compiled
def fill_tip_inertia(seen: Seen, out: Array) -> bool:
    """Inertia of the tip with the RCM held (3, 3) [kg]; False where the rows are dependent."""
    n, m = seen.q.size, 3 + seen.rows
    L, J, Y, A = scratch_matrix(n, n), scratch_matrix(m, n), scratch_matrix(m, n), scratch_matrix(m, m)
    L[:] = seen.M
    J[:3], J[3:] = seen.Jv_WT, seen.J_rcm[: seen.rows]
    Y[:] = J
    if not factor(L):
        return False
    back_substitute_rows(L, Y)
    outer_product(J, Y, A)
    if not factor(A):
        return False
    fill_held_inertia(A, out)
    return True


@compiled
def affordable_speed(inertia: Array, velocity: Array, budget_j: float) -> float:
    """Largest factor in [0, 1] for a velocity v (3,) [m/s] whose energy v' L v / 2 a budget covers."""
    moved = scratch(3)
    times(inertia, velocity, moved)
    energy = 0.5 * MARGIN * dot(velocity, moved)
    return 1.0 if energy <= budget_j else math.sqrt(max(budget_j, 0.0) / energy)


@compiled
def throttle(inertia: Array, velocity: Array, budget_j: float, period_s: float, drive: Array) -> None:
    """Scale the acceleration that drives the tip so that the tank covers the tip's kinetic energy.

    With the tip's inertia L, its velocity v and the drive's acceleration a, the energy that is left,

        T - epsilon - v' L v / 2 >= h a' L v + h^2 a' L a / 2,

    pays for the drive's work of the coming period h. What the tip then gives away is motion that was paid
    for: an impact takes from the tank what it takes from the motion. Where motion is not covered, since a
    tank has sent energy away, the tip is braked by up to `BRAKE_PER_S`, in proportion to what is missing.

    Args:
        inertia: L (3, 3) [kg].
        velocity: v (3,) [m/s].
        budget_j: T - epsilon [J].
        period_s: h [s].
        drive: a (3,) [m/s^2]; scaled.
    """
    moved, forced = scratch(3), scratch(3)
    times(inertia, velocity, moved)
    times(inertia, drive, forced)
    kinetic = 0.5 * MARGIN * dot(velocity, moved)
    left, power = budget_j - kinetic, MARGIN * dot(drive, moved)
    own = 0.5 * MARGIN * period_s * period_s * dot(drive, forced)
    if left >= 0.0:
        share = affordable(period_s * power, own, left)
        for i in range(3):
            drive[i] = share * drive[i]
        return
    brake = BRAKE_PER_S * min(1.0, -left / kinetic)
    if power > -2.0 * brake * kinetic:  # it does not brake so much by itself
        for i in range(3):
            drive[i] = -brake * velocity[i]


@compiled
def limit_press(inertia: Array, f: Array, most_n: float, drive: Array) -> None:
    """Scale the acceleration that drives the tip so that its force L a against what it touches is limited.

    A press that lasts has this force. One that takes more than a joint's torque would be held by letting the
    posture run off.

    Args:
        inertia: L (3, 3) [kg].
        f: Force of the surroundings on the tip (3,) [N].
        most_n: Largest force against it [N].
        drive: a (3,) [m/s^2]; scaled where it is against f.
    """
    forced = scratch(3)
    times(inertia, drive, forced)
    size = norm(forced)
    if dot(forced, f) < 0.0 and size > most_n:
        for i in range(3):
            drive[i] *= most_n / size
