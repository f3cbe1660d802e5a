"""Vector-field inequalities at velocity level: the port's sphere, and zones that shaft or tip keep to.

With the squared distance D of two things, one of them the instrument's, the row

    D' <= eta (R^2 - D)     keeps D <= R^2: inside;     -D' <= eta (D - R^2)     keeps D >= R^2: outside

since R^2 - D, or D - R^2, then decays no faster than exp(-eta t). D is squared because the distance has no
gradient where it is zero. The instrument's point nearest to the other thing is p + t z, on the line through
the shaft's end p along the shaft z, or the tip p itself, t = 0; c is the point of the other thing nearest to
that:

    delta = p + t z - c,   D = delta . delta,   D' = J_D q' + zeta
    J_D = 2 delta^T (J_p - t [z]x J_w),   zeta = -2 delta . c'

t and c may be held in the derivative: D is stationary in both.

Source: Marinho, Adorno, Harada and Mitsuishi, IEEE T-RO 35:1166 (2019), and, for the port's sphere, Marinho
et al., ICRA 2019 (arXiv 1809.07907).
"""

import math
from collections.abc import Sequence
from typing import Literal, Self

import numpy as np
from pydantic import PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.models.config import Vec3
from surgsim.tick.algebra import cross, dot
from surgsim.tick.arrays import Seen
from surgsim.tick.scratch import scratch

OF_SHAFT, IS_LINE, OUTSIDE, RADIUS, POINT, DIRECTION = 0, 1, 2, 3, 4, 7
"""Places of a zone's numbers; the point and the direction take three each."""
ZONE = 10
"""Numbers of a zone."""
_PARALLEL = 1e-9


class ZoneConfig(PartConfig):
    """A sphere or a cylinder of the world that the shaft's line, or the tip, stays in or out of.

    Attributes:
        of: What keeps to it: the `shaft`, as a line, or the `tip`.
        keep: On which side.
        point_m: Its centre, or a point on its axis [m].
        direction: Of a cylinder's axis; null: it is a sphere.
        radius_m: R [m].
    """

    of: Literal["shaft", "tip"] = "shaft"
    keep: Literal["inside", "outside"] = "outside"
    point_m: Vec3
    direction: Vec3 | None = None
    radius_m: PositiveFloat

    @model_validator(mode="after")
    def _direction_is_one(self) -> Self:
        if self.direction is not None and not any(self.direction):
            raise ValueError("direction must not be zero")
        return self


def zone_numbers(configs: Sequence[ZoneConfig]) -> Array:
    """Zones as `fill_zone_rows` takes them, in a row (10 k,)."""
    numbers: list[float] = []
    for zone in configs:
        along = zone.direction or (0.0, 0.0, 1.0)
        length = math.sqrt(sum(x * x for x in along))
        kind = (zone.of == "shaft", zone.direction is not None, zone.keep == "outside")
        numbers += [*map(float, kind), zone.radius_m, *zone.point_m, *(x / length for x in along)]
    return np.array(numbers, dtype=np.float64)


@compiled
def fill_zone_rows(zones: Array, eta: float, seen: Seen, G: Array, most: Array) -> None:
    """Rows that keep the shaft or the tip to its zones.

    Args:
        zones: From `zone_numbers` (10 k,).
        eta: How fast a zone's surface may be approached [1/s].
        seen: Tip, shaft and Jacobians.
        G: Rows, of which the first n columns are filled (k, n or more).
        most: Filled with their upper bounds (k,) [m^2/s].
    """
    delta = scratch(3)
    for k in range(most.size):
        zone = zones[ZONE * k : ZONE * (k + 1)]
        t = _apart(zone, seen, delta)
        sign = -1.0 if zone[OUTSIDE] != 0.0 else 1.0
        of_shaft = zone[OF_SHAFT] != 0.0
        _squared_distance_row(seen.Jv_WS if of_shaft else seen.Jv_WT, seen, delta, t, G[k])
        for j in range(seen.q.size):
            G[k, j] *= sign
        most[k] = sign * eta * (zone[RADIUS] * zone[RADIUS] - dot(delta, delta))


@compiled
def fill_entry_row(radius: float, eta: float, seen: Seen, row: Array) -> float:
    """Fill the first n entries of the row that keeps the shaft inside the sphere about the port; its bound.

    D = e_N . e_N, J_D = 2 e_N^T J_rcm and zeta = -2 e_N . N C' of the RCM error: delta without its component
    along the shaft, which is zero.

    Args:
        radius: R [m].
        eta: How fast the sphere's surface may be approached [1/s].
        seen: The RCM's kinematics.
        row: Filled (n or more,).
    """
    zeta = square = 0.0
    for k in range(2):
        square += seen.rcm_error[k] * seen.rcm_error[k]
        zeta -= 2.0 * seen.rcm_error[k] * seen.rcm_velocity[k]
    for j in range(seen.q.size):
        row[j] = 2.0 * (seen.rcm_error[0] * seen.J_rcm[0, j] + seen.rcm_error[1] * seen.J_rcm[1, j])
    return eta * (radius * radius - square) - zeta


@compiled
def _squared_distance_row(Jv: Array, seen: Seen, delta: Array, t: float, row: Array) -> None:
    """Fill the first n entries of `row` with J_D, with the Jacobian of p (3, n)."""
    z, w, moved = scratch(3), scratch(3), scratch(3)
    z[:] = seen.R_WT[:, 2]
    for j in range(seen.q.size):
        w[:] = seen.Jw_WT[:, j]
        cross(w, z, moved)
        s = 0.0
        for i in range(3):
            s += delta[i] * (Jv[i, j] + t * moved[i])
        row[j] = 2.0 * s


@compiled
def _apart(zone: Array, seen: Seen, delta: Array) -> float:
    """Fill delta (3,) [m], from the zone's centre or axis to the instrument; t [m]."""
    z, r, point, u = scratch(3), scratch(3), zone[POINT:DIRECTION], zone[DIRECTION:]
    z[:] = seen.R_WT[:, 2]
    for i in range(3):
        r[i] = (seen.p_WS[i] if zone[OF_SHAFT] != 0.0 else seen.p_WT[i]) - point[i]
    along = dot(r, u) if zone[IS_LINE] != 0.0 else 0.0
    t = 0.0
    if zone[OF_SHAFT] != 0.0:
        c = dot(z, u) if zone[IS_LINE] != 0.0 else 0.0
        if 1.0 - c * c > _PARALLEL:  # of two parallel lines the shaft's end is as near as any point
            t = (c * along - dot(r, z)) / (1.0 - c * c)
            along += t * c
    for i in range(3):
        delta[i] = r[i] + t * z[i] - along * u[i]
    return t
