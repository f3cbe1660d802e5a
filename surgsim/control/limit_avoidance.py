"""Null-space motion away from the ends of the joints' ranges.

To the answers of resolvers that share their null space the loop adds it (`keep_from_limits`). Resolvers that
solve a program, with limits and tasks of their own, have it in their objective (`fill_avoidance`).
"""

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.resolvers.rows import fill_roll_row
from surgsim.tick.algebra import nearest
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch, scratch_matrix

GAIN_PER_S = 5.0
"""Speed per way into the zone: the posture's default gains, which follow it, are critically damped then."""
MOST_OF_RANGE = 0.25
"""Share of a joint's range that a zone takes at most."""
_STILL = 1e-6
"""Share of the fastest joint's part below which a joint counts as standing still, which no bound hinders."""


@compiled
def fill_avoidance(seen: Seen, rolls: bool, away: Array) -> bool:
    """Fill the joint velocity that leads out of the zones and that no task notices.

        (I - pinv(J) J) u,    u_i = g (max(z_i - (q_i - q_min,i), 0) - max(z_i - (q_max,i - q_i), 0))

    with J = [J_T; J_rcm], and the roll about the shaft below them if `rolls`.

    Args:
        seen: State, range, and `limit_zone`: z, at most a quarter of a joint's range.
        rolls: Whether the resolver moves the roll, which is left alone then.
        away: Filled (n,) [rad/s].

    Returns:
        Whether there is any; not outside all zones, nor where J has lost rank.

    Source: ours; the projection is that of Liegeois (IEEE Trans. Systems, Man and Cybernetics 7, 1977), whose
    criterion draws to the middle of the range from everywhere.
    """
    n, near = seen.q.size, False
    if not seen.limit_zone > 0.0:
        return False
    for i in range(n):
        width = min(seen.limit_zone, MOST_OF_RANGE * (seen.q_max[i] - seen.q_min[i]))
        below = max(width - (seen.q[i] - seen.q_min[i]), 0.0)
        above = max(width - (seen.q_max[i] - seen.q[i]), 0.0)
        away[i] = GAIN_PER_S * (below - above)
        near = near or away[i] != 0.0
    if not near:
        return False
    m = 3 + seen.rows + (1 if rolls else 0)
    J, still = scratch_matrix(m, n), scratch(m)
    still[:] = 0.0
    J[:3] = seen.Jv_WT
    J[3 : 3 + seen.rows] = seen.J_rcm[: seen.rows]
    if rolls:
        fill_roll_row(seen, J[m - 1])
    found: bool = nearest(J, still, away, away)
    return found


@compiled
def keep_from_limits(seen: Seen, out: Resolved) -> None:
    """Add it to an answer, the largest share s <= 1 of it that keeps q'_r in Omega.

    Outside the zones every bit of the answer stays.

    Args:
        seen: What the resolver saw.
        out: Its answer; the roll about the shaft is taken to be free.
    """
    n, share, most = seen.q.size, 1.0, 0.0
    away = scratch(n)
    if not fill_avoidance(seen, False, away):
        return
    for i in range(n):
        most = max(most, abs(away[i]))
    for i in range(n):
        if abs(away[i]) > _STILL * most:
            room = (seen.upper[i] if away[i] > 0.0 else seen.lower[i]) - out.qdot[i]
            share = min(share, max(room / away[i], 0.0))
    for i in range(n):
        out.qdot[i] = min(max(out.qdot[i] + share * away[i], seen.lower[i]), seen.upper[i])
