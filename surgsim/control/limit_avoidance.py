"""Null-space motion away from the ends of the joints' ranges, whichever resolver answers."""

from surgsim.compiled import compiled
from surgsim.tick.algebra import nearest
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch, scratch_matrix

GAIN_PER_S = 5.0
"""Speed per way into the zone: the posture's default gains, which follow it, are critically damped then."""
_MOST_OF_RANGE = 0.25
_STILL = 1e-6
"""Share of the fastest joint's part below which a joint counts as standing still, which no bound hinders."""


@compiled
def keep_from_limits(zone: float, seen: Seen, out: Resolved) -> None:
    """Add to the answer what leads out of the zones at the ends of the joints' ranges, in the null space.

        q'_r += s (I - pinv(J) J) u
        u_i = g (max(z_i - (q_i - q_min,i), 0) - max(z_i - (q_max,i - q_i), 0))

    with J = [J_T; J_rcm], so that neither the tip nor the shaft in the trocar notices. s <= 1 is the largest
    share that keeps q'_r in Omega. Outside the zones the answer stays as it is; so it does where J has lost
    rank.

    Args:
        zone: z, width of a zone, at most a quarter of the joint's range [rad].
        seen: What the resolver saw.
        out: Its answer.

    Source: ours; the projection is that of Liegeois (IEEE Trans. Systems, Man and Cybernetics 7, 1977), whose
    criterion draws to the middle of the range from everywhere.
    """
    n, m, near = seen.q.size, 3 + seen.rows, False
    away = scratch(n)
    for i in range(n):
        width = min(zone, _MOST_OF_RANGE * (seen.q_max[i] - seen.q_min[i]))
        below = max(width - (seen.q[i] - seen.q_min[i]), 0.0)
        above = max(width - (seen.q_max[i] - seen.q[i]), 0.0)
        away[i] = GAIN_PER_S * (below - above)
        near = near or away[i] != 0.0
    if not near:
        return
    J, still, share, most = scratch_matrix(m, n), scratch(m), 1.0, 0.0
    still[:] = 0.0
    J[:3] = seen.Jv_WT
    J[3:] = seen.J_rcm[: m - 3]
    if not nearest(J, still, away, away):
        return
    for i in range(n):
        most = max(most, abs(away[i]))
    for i in range(n):
        if abs(away[i]) > _STILL * most:
            room = (seen.upper[i] if away[i] > 0.0 else seen.lower[i]) - out.qdot[i]
            share = min(share, max(room / away[i], 0.0))
    for i in range(n):
        out.qdot[i] = min(max(out.qdot[i] + share * away[i], seen.lower[i]), seen.upper[i])
