"""Position-force: the hand feels the measured force of the tip, delayed."""

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


class PositionForceConfig(PartConfig):
    """Position-force: the tip is drawn to where the handle was; the hand feels what the tip measured.

    Attributes:
        stiffness_n_per_m: K of the remote spring, in the tip's scale [N/m].
        damping_ns_per_m: B of the remote damper, in the tip's scale [N s/m].
        force_gain: Share of the measured force that is rendered.
        follower: What the remote force drives.
    """

    type: Literal["position_force"] = "position_force"
    stiffness_n_per_m: NonNegativeFloat = 240.0
    damping_ns_per_m: NonNegativeFloat = 40.0
    force_gain: NonNegativeFloat = 1.0
    follower: FollowerConfig = FollowerConfig()

    def build(self, period_s: float, round_trip_s: float) -> BilateralScheme:
        """The scheme; it does not depend on the delay."""
        gains = numbers(PositionForceLaw, self)
        return BilateralScheme(feel=feel, tell=tell, follow=follow, gains=gains, memory_size=MEMORY_SIZE)


class PositionForceLaw(Record):
    """Numbers: K, B, the force's gain, and those of the follower."""

    stiffness_n_per_m: float
    damping_ns_per_m: float
    force_gain: float
    follower: FollowerLaw


LAW, LAW_SIZE = overlay(PositionForceLaw)
MEMORY, MEMORY_SIZE = overlay(Follower)


@compiled
def feel(gains: Array, end: End, memory: Array) -> int:
    """f_m = -g f_e(t - T2), with the force f_e of the tip on its surroundings.

    Source: position-force architecture, e.g. Lawrence, IEEE Trans. Robot. Autom. 9(5), 1993, section III.
    """
    law = gains[:LAW_SIZE].view(LAW)[0]
    for i in range(3):
        end.command[i] = -law.force_gain * end.trust * end.received[FORCE + i]
    return GOES_ON


@compiled
def follow(gains: Array, end: End, memory: Array) -> int:
    """f_s = K (x_m(t - T1) - x_s) + B (v_m(t - T1) - v_s), on the follower; the measured force goes back."""
    law, follower = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    force = scratch(3)
    couple(end, law.stiffness_n_per_m, law.damping_ns_per_m, force)
    drive(law.follower, follower, end, force)
    tell_motion(end)
    return GOES_ON
