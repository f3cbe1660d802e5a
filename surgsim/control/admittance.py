"""What admittances share: what of a force counts, and the mass that gives way to it."""

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.algebra import norm


@compiled
def heed(force: Array, tare: Array, count: float, learns: bool, dead_zone: float) -> None:
    """Leave of a force (3,) [N] what counts: the tare taken off, and less by the dead zone.

    Args:
        force: Changed; zeros while the tare is learnt.
        tare: Mean of the forces so far while it is learnt (3,) [N], changed then.
        count: Forces so far, this one included.
        learns: Whether the tare is learnt.
        dead_zone: F_0: F becomes F (1 - F_0/|F|), 0 below F_0 [N].
    """
    for i in range(3):
        if learns:
            tare[i] += (force[i] - tare[i]) / count
            force[i] = 0.0
        else:
            force[i] -= tare[i]
    size = norm(force)
    share = max(1.0 - dead_zone / size, 0.0) if size > 0.0 else 0.0
    for i in range(3):
        force[i] *= share


@compiled
def give_way(
    force: Array, mass: float, damping: float, stiffness: float, most: float, dt: float, e: Array, rate: Array
) -> None:
    """Move e (3,) [m] and its rate (3,) [m/s] by a period: M e'' + D e' + K e = F, |e| <= most.

    Semi-implicit Euler with implicit damping. Where e would go farther it stops there.
    """
    for i in range(3):
        moving = mass * rate[i] + dt * (force[i] - stiffness * e[i])
        rate[i] = moving / (mass + dt * damping)
        e[i] += dt * rate[i]
    size = norm(e)
    if size > most:
        for i in range(3):
            e[i] *= most / size
            rate[i] = 0.0
