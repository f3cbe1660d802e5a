"""Position-position: a spring and a damper at each end, to the other one as it was."""

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
from surgsim.tick.arrays import Record
from surgsim.tick.overlay import overlay
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON


class PositionPositionConfig(PartConfig):
    """Position-position: each end is drawn to where the other one was, by a spring and a damper.

    Attributes:
        stiffness_n_per_m: K, in the tip's scale [N/m].
        damping_ns_per_m: B, in the tip's scale [N s/m].
        follower: What the remote force drives.
    """

    type: Literal["position_position"] = "position_position"
    stiffness_n_per_m: NonNegativeFloat = 240.0
    damping_ns_per_m: NonNegativeFloat = 20.0
    follower: FollowerConfig = FollowerConfig()

    def build(self, period_s: float, round_trip_s: float) -> BilateralScheme:
        """The scheme; it does not depend on the delay."""
        gains = numbers(PositionPositionLaw, self)
        return BilateralScheme(feel=feel, tell=tell, follow=follow, gains=gains, memory_size=MEMORY_SIZE)


class PositionPositionLaw(Record):
    """Numbers: K, B, and those of the follower."""

    stiffness_n_per_m: float
    damping_ns_per_m: float
    follower: FollowerLaw


LAW, LAW_SIZE = overlay(PositionPositionLaw)
MEMORY, MEMORY_SIZE = overlay(Follower)


@compiled
def feel(gains: Array, end: End, memory: Array) -> int:
    """f_m = K (x_s(t - T2) - x_m) + B (v_s(t - T2) - v_m).

    Source: position error architecture, e.g. Lawrence, IEEE Trans. Robot. Autom. 9(5), 1993, section III;
    Hokayem, Spong, Automatica 42(12), 2006, section 3.
    """
    law = gains[:LAW_SIZE].view(LAW)[0]
    couple(end, law.stiffness_n_per_m, law.damping_ns_per_m, end.command)
    return GOES_ON


@compiled
def follow(gains: Array, end: End, memory: Array) -> int:
    """f_s = K (x_m(t - T1) - x_s) + B (v_m(t - T1) - v_s), on the follower."""
    law, follower = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    force = scratch(3)
    couple(end, law.stiffness_n_per_m, law.damping_ns_per_m, force)
    drive(law.follower, follower, end, force)
    tell_motion(end)
    return GOES_ON
