"""Passive set-position modulation: a spring to a set position that moves as far as stored energy allows."""

import math
from typing import ClassVar, Literal

from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.teleop.bilateral.base import BilateralScheme, End, numbers
from surgsim.teleop.bilateral.follower import (
    Follower,
    FollowerConfig,
    FollowerLaw,
    drive,
    tell_motion,
)
from surgsim.teleop.messages import POSITION
from surgsim.tick.arrays import Record
from surgsim.tick.overlay import overlay
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON


class PassiveSetPositionConfig(PartConfig):
    """Passive set-position modulation (PSPM): the received position is followed as far as energy is in stock.

    What the dampers burn fills the stock.

    Attributes:
        initial_j: What the stock of each end holds at first [J].
        stiffness_n_per_m: K, in the tip's scale [N/m].
        damping_ns_per_m: B, in the tip's scale [N s/m].
        stock_j: What a stock may hold; more is sent to the other end [J].
        follower: What the remote force drives.
    """

    type: Literal["passive_set_position"] = "passive_set_position"
    stiffness_n_per_m: PositiveFloat = 240.0
    damping_ns_per_m: NonNegativeFloat = 20.0
    initial_j: NonNegativeFloat = 0.2
    stock_j: PositiveFloat = 0.2
    follower: FollowerConfig = FollowerConfig()

    def build(self, period_s: float, round_trip_s: float) -> BilateralScheme:
        """The scheme; it does not depend on the delay."""
        gains = numbers(SetPositionLaw, self)
        return BilateralScheme(feel=feel, tell=tell, follow=follow, gains=gains, memory_size=MEMORY_SIZE)


class SetPositionLaw(Record):
    """Numbers, as in `PassiveSetPositionConfig`."""

    stiffness_n_per_m: float
    damping_ns_per_m: float
    initial_j: float
    stock_j: float
    follower: FollowerLaw


class SetPositionMemory(Record):
    """What an end remembers.

    Attributes:
        begun: Whether the stock is filled and the rest set.
        stock_j: E [J].
        sent_j: What was sent at the last period [J].
        set_position: The modulated set position (3,) [m].
        last: Position at the last period (3,) [m].
        follower: The follower.
    """

    SHAPES: ClassVar[dict[str, str]] = {"set_position": "3", "last": "3"}
    begun: int
    stock_j: float
    sent_j: float
    set_position: Array
    last: Array
    follower: Follower


LAW, LAW_SIZE = overlay(SetPositionLaw)
MEMORY, MEMORY_SIZE = overlay(SetPositionMemory)


@compiled
def modulate(law: SetPositionLaw, known: SetPositionMemory, end: End, out: Array) -> None:
    """The spring's and the damper's force (3,) [N], after the set position has moved as far as E allows.

        E += E_in + D,   D = B |dx|^2 / h           what came, and what the damper has burnt
        x* = x + (y - x) min(1, r / |y - x|),       K r^2 / 2 = E + K |x*_last - x|^2 / 2
        E -= K |x* - x|^2 / 2 - K |x*_last - x|^2 / 2
        f = K (x* - x) - B v

    with the received position y. So the spring never gets more than there is, and E never falls below 0. What
    exceeds the stock is sent.

    Args:
        law: K, B, the stock's limit.
        known: E, x*, the last x; changed.
        end: x, v, y.
        out: Filled with f.

    Source: Lee, Huang, IEEE Trans. Robot. 26(2), 2010; a period for their interval between packets.
    """
    if known.begun == 0:
        known.begun, known.stock_j = 1, law.initial_j
        for i in range(3):
            known.set_position[i] = known.last[i] = end.position[i]
    moved = before = distance = 0.0
    for i in range(3):
        moved += (end.position[i] - known.last[i]) ** 2
        before += (known.set_position[i] - end.position[i]) ** 2
        distance += (end.received[POSITION + i] - end.position[i]) ** 2
        known.last[i] = end.position[i]
    known.stock_j += end.received_j + law.damping_ns_per_m * moved / end.period_s
    if end.fresh != 0:
        room = before + 2.0 * max(known.stock_j, 0.0) / law.stiffness_n_per_m
        share = 1.0 if distance <= room else math.sqrt(room / distance)
        for i in range(3):
            away = end.received[POSITION + i] - end.position[i]
            known.set_position[i] = end.position[i] + share * away
        known.stock_j -= 0.5 * law.stiffness_n_per_m * (share * share * distance - before)
    known.sent_j = max(known.stock_j - law.stock_j, 0.0)
    known.stock_j -= known.sent_j
    for i in range(3):
        out[i] = law.stiffness_n_per_m * (known.set_position[i] - end.position[i])
        out[i] -= law.damping_ns_per_m * end.velocity[i]
    end.stored_j = end.observed_j = known.stock_j
    end.deficit_j = max(end.deficit_j, -known.stock_j)


@compiled
def feel(gains: Array, end: End, memory: Array) -> int:
    """f_m = K (x* - x_m) - B v_m, see `modulate`."""
    law, known = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    modulate(law, known, end, end.command)
    return GOES_ON


@compiled
def tell(gains: Array, end: End, memory: Array) -> int:
    """Position of the handle, and the energy that its stock need not keep."""
    known = memory[:MEMORY_SIZE].view(MEMORY)[0]
    tell_motion(end)
    end.energy_j = known.sent_j
    return GOES_ON


@compiled
def follow(gains: Array, end: End, memory: Array) -> int:
    """f_s = K (x* - x_s) - B v_s, see `modulate`, on the follower."""
    law, known = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    force = scratch(3)
    modulate(law, known, end, force)
    drive(law.follower, known.follower, end, force)
    tell_motion(end)
    end.energy_j = known.sent_j
    return GOES_ON
