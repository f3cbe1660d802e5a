"""Hands-on guidance: the tip gives way to a hand as a mass would, the shaft stays in the port."""

from typing import Annotated, Any, Literal, Union

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig, Surroundings
from surgsim.columns import vector, width
from surgsim.compiled import compiled
from surgsim.control.admittance import give_way, heed
from surgsim.control.inside import HEAD_SIZE, resolve_below
from surgsim.control.joining import memory_size
from surgsim.control.planes import PlaneConfig, plane_numbers
from surgsim.control.port_force import split_wrench
from surgsim.control.redundancy import redundancy_needed, shares_null_space
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.pinv import PinvConfig
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import dot
from surgsim.tick.arrays import Resolved, Seen
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON

_OTHERS = tuple(RESOLVERS.usable(name) for name in RESOLVERS.names() if name not in ("policy", "hands_on"))
AnyPlainResolver: Any = Annotated[Union[_OTHERS], Field(discriminator="type", title="resolver")]  # noqa: UP007
MASS, DAMPING, STIFFNESS, DEAD_ZONE, HAND, LEAST_DEPTH, TARE_S, MOST, BARRIER, RANGE, COLUMN, WALLS = range(
    HEAD_SIZE, HEAD_SIZE + 12
)
"""Places of the gains; COLUMN is where its own columns begin, WALLS where each wall has four numbers."""
AWAY, RATE, TARE, TICKS, BELOW = slice(0, 3), slice(3, 6), slice(6, 9), 9, 10
"""Memory: e (3,) [m], its rate (3,) [m/s], tare (3,) [N], ticks; then that of the resolver below."""


class HandsOnConfig(PartConfig):
    """Lets a hand lead the tip, by the force that a sensor at the flange measures.

    Attributes:
        mass_kg: M of the admittance at the tip [kg].
        damping_n_s_per_m: D [N s/m].
        stiffness_n_per_m: K, that pulls the tip back to its path [N/m]; 0: it stays where it was led to.
        dead_zone_n: Forces of the hand below this move nothing [N].
        hand_from_tip_m: Where the hand holds the shaft, from its end [m].
        least_depth_m: The lever from port to tip counts as at least this [m].
        tare_s: The mean force over this first time is taken off; nobody may hold the instrument so long [s].
        most_m: Farthest that the tip may be led from its path [m].
        planes: Walls of the region that the tip is kept in.
        barrier_n_m3: Strength k of the walls' repulsion [N m^3].
        barrier_range_m: How near to a wall it begins [m].
        resolver: Resolves the tip's motion and holds the RCM.
    """

    type: Literal["hands_on"] = "hands_on"
    mass_kg: PositiveFloat = 2.0
    damping_n_s_per_m: PositiveFloat = 30.0
    stiffness_n_per_m: NonNegativeFloat = 0.0
    dead_zone_n: NonNegativeFloat = 0.3
    hand_from_tip_m: Annotated[float, Field(gt=0.0, le=1.0)] = 0.4
    least_depth_m: Annotated[float, Field(gt=0.0, le=0.3)] = 0.05
    tare_s: NonNegativeFloat = 0.2
    most_m: PositiveFloat = 0.1
    planes: tuple[PlaneConfig, ...] = ()
    barrier_n_m3: NonNegativeFloat = 1e-6
    barrier_range_m: PositiveFloat = 0.02
    resolver: AnyPlainResolver = PinvConfig()

    @property
    def needs_redundancy(self) -> int:
        """As much as the resolver below."""
        return redundancy_needed(self.resolver)

    @property
    def shares_null_space(self) -> bool:
        """Whether the resolver below does."""
        return shares_null_space(self.resolver)

    def check(self, scenario: Surroundings) -> None:
        """Refuse a scenario without the sensor that feels the hand."""
        if not scenario.has_force_sensor:
            raise ValueError("controller.resolver 'hands_on' needs the disturbance force_torque_sensor")
        self.resolver.check(scenario)

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver."""
        own = (
            self.mass_kg,
            self.damping_n_s_per_m,
            self.stiffness_n_per_m,
            self.dead_zone_n,
            self.hand_from_tip_m,
            self.least_depth_m,
            self.tare_s,
            self.most_m,
            self.barrier_n_m3,
            self.barrier_range_m,
        )
        below: Any = self.resolver.build(arm)
        columns = tuple(getattr(below, "columns", ()))
        return KernelResolver(
            kernel=hands_on,
            arm=arm,
            gains=np.concatenate((np.zeros(HEAD_SIZE), own, (width(columns),), plane_numbers(self.planes))),
            memory_size=BELOW + memory_size(below),
            columns=(*columns, vector("hand_force", "n")),
            below=below,
        )


@compiled
def hands_on(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
    """The tip is led away from its path by e, and the resolver below follows p_WTd + e.

        M e'' + D e' + K e = F_T - grad V,   F_T = (F_h z) z - ((l - s)/s) N F_h

    F_h is the force of a hand on the shaft, l above the tip, told apart from that of the wall at the depth s
    by the moment (`surgsim.control.port_force.split_wrench`); along the shaft all of the force is taken for
    the hand's. F_T does the same work at the tip as F_h does at the hand, with the shaft turning about the
    port: so the hand feels a passive body, whatever the lever is, while the tip is at least `least_depth_m`
    deep. V keeps the led tip on the inner side of the walls n p <= o: with the gap g and its range g_0,

        - grad V = - k (1/g - 1/g_0) / g^2 n     for g < g_0,    g = max(o - n p_WTd, g_0) - n e

    and e goes no farther than to the wall. A path that itself comes nearer to a wall than g_0 moves the wall
    along: walls hold back the hand, not the task.

    Source: the target admittance with RCM constraint and forbidden regions of Kastritsi and Doulgeri
    (arXiv 2202.10783), whose gains and variable damping were not seen; the RCM is held by the rows of the
    resolver here, not by a potential. V is that of Khatib, Int. J. Robotics Research 5:90 (1986).
    """
    dt = seen.dt_s
    away, rate, tare = memory[AWAY], memory[RATE], memory[TARE]
    hand, force = scratch(3), scratch(3)
    _felt(gains, seen, hand)
    memory[TICKS] += 1.0
    heed(hand, tare, memory[TICKS], seen.t_s < gains[TARE_S], gains[DEAD_ZONE])
    _at_tip(gains, seen, hand, force)
    _repel(gains, seen, away, force)
    kept, before = scratch(9), scratch(3)
    before[:] = rate
    give_way(force, gains[MASS], gains[DAMPING], gains[STIFFNESS], gains[MOST], dt, away, rate)
    _stop_at_walls(gains, seen, away, rate)
    for i in range(3):
        kept[i], kept[3 + i], kept[6 + i] = seen.p_WTd[i], seen.v_WTd[i], seen.a_WTd[i]
        seen.p_WTd[i] += away[i]
        seen.v_WTd[i] += rate[i]
        seen.a_WTd[i] += (rate[i] - before[i]) / dt
    status = resolve_below(gains, seen, memory[BELOW:], out)
    if status != GOES_ON:  # what is seen stays as the resolver below saw it, for who looks into it
        return status
    own = int(gains[COLUMN])
    for i in range(3):
        out.p_WTd[i], out.v_WTd[i], out.a_WTd[i] = seen.p_WTd[i], seen.v_WTd[i], seen.a_WTd[i]
        seen.p_WTd[i], seen.v_WTd[i], seen.a_WTd[i] = kept[i], kept[3 + i], kept[6 + i]
        out.values[own + i] = hand[i]
    return GOES_ON


@compiled
def _felt(gains: Array, seen: Seen, hand: Array) -> None:
    """Fill the force of the hand on the shaft (3,) [N]; zeros where nothing is felt."""
    port = scratch(3)
    for i in range(3):
        hand[i] = 0.0
    if not seen.has_wrench:
        return
    along = 0.0
    for i in range(3):
        along += seen.R_WT[i, 2] * seen.f_S[i]
    if seen.has_trocar:
        split_wrench(seen, gains[HAND], port, hand)
    else:
        for i in range(3):
            hand[i] = seen.f_S[i] - along * seen.R_WT[i, 2]
    for i in range(3):
        hand[i] += along * seen.R_WT[i, 2]


@compiled
def _at_tip(gains: Array, seen: Seen, hand: Array, force: Array) -> None:
    """Fill the force at the tip (3,) [N] that does the work of the hand, by the lever about the port."""
    along, lever = 0.0, -1.0
    for i in range(3):
        along += seen.R_WT[i, 2] * hand[i]
    if seen.has_trocar:
        depth = max(seen.depth, gains[LEAST_DEPTH])
        lever = (gains[HAND] - depth) / depth
    for i in range(3):
        axial = along * seen.R_WT[i, 2]
        force[i] = axial - lever * (hand[i] - axial)


@compiled
def _repel(gains: Array, seen: Seen, away: Array, force: Array) -> None:
    """Add the repulsion of the walls on the led tip; a twentieth of the range nearer it grows no more."""
    reach = gains[RANGE]
    for at in range(WALLS, gains.size, 4):
        normal = gains[at : at + 3]
        gap = max(_room(gains, seen, at) - dot(normal, away), 0.05 * reach)
        if gap < reach:
            size = gains[BARRIER] * (1.0 / gap - 1.0 / reach) / (gap * gap)
            for i in range(3):
                force[i] -= size * normal[i]


@compiled
def _room(gains: Array, seen: Seen, at: int) -> float:
    """How far the tip may be led towards the wall whose numbers begin at `at` [m]."""
    room: float = max(gains[at + 3] - dot(gains[at : at + 3], seen.p_WTd), gains[RANGE])
    return room


@compiled
def _stop_at_walls(gains: Array, seen: Seen, away: Array, rate: Array) -> None:
    """Lead the tip no farther than to a wall."""
    for at in range(WALLS, gains.size, 4):
        normal = gains[at : at + 3]
        over, speed = dot(normal, away) - _room(gains, seen, at), dot(normal, rate)
        if over > 0.0:
            for i in range(3):
                away[i] -= over * normal[i]
                rate[i] -= max(speed, 0.0) * normal[i]
