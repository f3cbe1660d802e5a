"""P+d: a spring to the other end as it was, and enough damping at both for the delay."""

from typing import Literal

from pydantic import NonNegativeFloat, PositiveFloat

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


def enough_damping(stiffness_n_per_m: float, round_trip_s: float) -> float:
    """Least damping B of both ends for a spring K at both: 2 B = (T1 + T2) K [N s/m].

    Source: 4 B_m B_s > (T1 + T2)^2 K_m K_s, Nuno, Ortega, Barabanov, Basanez, IEEE Trans. Robot. 24(3), 2008.
    """
    return 0.5 * round_trip_s * stiffness_n_per_m


class PPlusDConfig(PartConfig):
    """P+d: a spring at each end to where the other one was, and damping injected at both.

    Attributes:
        stiffness_n_per_m: K, in the tip's scale [N/m].
        damping_ns_per_m: B of both ends, in the tip's scale [N s/m]; `auto`: what the round trip needs, times
            `margin`, and at least `least_damping_ns_per_m`.
        margin: Of the automatic damping, for what the mean delay does not say: jitter, the hold of a period.
        least_damping_ns_per_m: Of the automatic damping [N s/m].
        follower: What the remote force drives.
    """

    type: Literal["p_plus_d"] = "p_plus_d"
    stiffness_n_per_m: NonNegativeFloat = 240.0
    damping_ns_per_m: NonNegativeFloat | Literal["auto"] = "auto"
    margin: PositiveFloat = 1.2
    least_damping_ns_per_m: NonNegativeFloat = 10.0
    follower: FollowerConfig = FollowerConfig()

    def build(self, period_s: float, round_trip_s: float) -> BilateralScheme:
        """The scheme, with the damping for that round trip and the two periods that a message waits [s]."""
        known = self
        if self.damping_ns_per_m == "auto":
            needed = self.margin * enough_damping(self.stiffness_n_per_m, round_trip_s + 2.0 * period_s)
            most = max(needed, self.least_damping_ns_per_m)
            known = self.model_copy(update={"damping_ns_per_m": most})
        gains = numbers(PPlusDLaw, known)
        return BilateralScheme(feel=feel, tell=tell, follow=follow, gains=gains, memory_size=MEMORY_SIZE)


class PPlusDLaw(Record):
    """Numbers: K, B, and those of the follower."""

    stiffness_n_per_m: float
    damping_ns_per_m: float
    follower: FollowerLaw


LAW, LAW_SIZE = overlay(PPlusDLaw)
MEMORY, MEMORY_SIZE = overlay(Follower)


@compiled
def _pull(gains: Array, end: End, out: Array) -> None:
    """K (x' - x) - B v (3,) [N]."""
    law = gains[:LAW_SIZE].view(LAW)[0]
    couple(end, law.stiffness_n_per_m, 0.0, out)
    for i in range(3):
        out[i] -= law.damping_ns_per_m * end.velocity[i]


@compiled
def feel(gains: Array, end: End, memory: Array) -> int:
    """f_m = K (x_s(t - T2) - x_m) - B_m v_m.

    Source: Nuno, Ortega, Barabanov, Basanez, IEEE Trans. Robot. 24(3), 2008; Nuno, Basanez, Ortega,
    Automatica 47, 2011, section 4: stable for constant delays if 4 B_m B_s > (T1 + T2)^2 K^2.
    """
    _pull(gains, end, end.command)
    return GOES_ON


@compiled
def follow(gains: Array, end: End, memory: Array) -> int:
    """f_s = K (x_m(t - T1) - x_s) - B_s v_s, on the follower."""
    law, follower = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    force = scratch(3)
    _pull(gains, end, force)
    drive(law.follower, follower, end, force)
    tell_motion(end)
    return GOES_ON
