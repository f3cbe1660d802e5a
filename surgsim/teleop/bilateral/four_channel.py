"""Four-channel: motion and force both ways, transparent without delay."""

from typing import Literal

from pydantic import NonNegativeFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.teleop.bilateral.base import BilateralScheme, End, numbers
from surgsim.teleop.bilateral.follower import (
    Follower,
    FollowerConfig,
    FollowerLaw,
    couple,
    drive,
    tell,
    tell_motion,
)
from surgsim.teleop.messages import FORCE
from surgsim.tick.arrays import Record
from surgsim.tick.overlay import overlay
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON


class FourChannelConfig(PartConfig):
    """Four-channel: each end is drawn to the other's motion, and gets the force that acts there.

    Attributes:
        stiffness_n_per_m: K of both ends, in the tip's scale [N/m].
        damping_ns_per_m: B of both ends, in the tip's scale [N s/m].
        hand_gain: C3: share of the hand's force that drives the tip.
        tip_gain: C2: share of the tip's force that the hand gets.
        follower: What the remote force drives.
    """

    type: Literal["four_channel"] = "four_channel"
    stiffness_n_per_m: NonNegativeFloat = 240.0
    damping_ns_per_m: NonNegativeFloat = 20.0
    hand_gain: NonNegativeFloat = 1.0
    tip_gain: NonNegativeFloat = 1.0
    follower: FollowerConfig = FollowerConfig()

    def build(self, period_s: float, round_trip_s: float) -> BilateralScheme:
        """The scheme; it does not depend on the delay."""
        gains = numbers(FourChannelLaw, self)
        return BilateralScheme(feel=feel, tell=tell, follow=follow, gains=gains, memory_size=MEMORY_SIZE)


class FourChannelLaw(Record):
    """Numbers: K, B, C3, C2, and those of the follower."""

    stiffness_n_per_m: float
    damping_ns_per_m: float
    hand_gain: float
    tip_gain: float
    follower: FollowerLaw


LAW, LAW_SIZE = overlay(FourChannelLaw)
MEMORY, MEMORY_SIZE = overlay(Follower)


@compiled
def _add_force(end: End, gain: float, out: Array) -> None:
    """Add the other end's force, as it is known, to `out` (3,) [N]."""
    for i in range(3):
        out[i] += gain * end.trust * end.received[FORCE + i]


@compiled
def feel(gains: Array, end: End, memory: Array) -> int:
    """f_m = C (x_s(t - T2) - x_m) - C2 f_e(t - T2),   C = K + B d/dt.

    With C1 = C4 = C, C2 = C3 = 1 and no delay the positions are one and the hand's force is the tip's, up to
    the handle's and the follower's own masses.

    Source: Lawrence, IEEE Trans. Robot. Autom. 9(5), 1993, section IV, C1 = Z_cs, C2 = C3 = 1, C4 = -Z_cm.
    """
    law = gains[:LAW_SIZE].view(LAW)[0]
    couple(end, law.stiffness_n_per_m, law.damping_ns_per_m, end.command)
    _add_force(end, -law.tip_gain, end.command)
    return GOES_ON


@compiled
def follow(gains: Array, end: End, memory: Array) -> int:
    """f_s = C (x_m(t - T1) - x_s) + C3 f_h(t - T1), on the follower."""
    law, follower = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    force = scratch(3)
    couple(end, law.stiffness_n_per_m, law.damping_ns_per_m, force)
    _add_force(end, law.hand_gain, force)
    drive(law.follower, follower, end, force)
    tell_motion(end)
    return GOES_ON
