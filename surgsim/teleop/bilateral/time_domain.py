"""Time-domain passivity with force feedback: a time-delay power network, watched at both of its ports."""

from typing import ClassVar, Literal

from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.teleop.bilateral.base import BilateralScheme, End, numbers
from surgsim.teleop.bilateral.follower import Follower, FollowerConfig, FollowerLaw, drive, tell_motion
from surgsim.teleop.messages import FORCE, POSITION, VELOCITY
from surgsim.teleop.passivity_control import (
    PassivityLaw,
    PortEnergy,
    admittance_control,
    compensate_drift,
    impedance_control,
    observe,
    observed,
)
from surgsim.tick.algebra import dot
from surgsim.tick.arrays import Record
from surgsim.tick.overlay import overlay
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON


class TimeDomainConfig(PartConfig):
    """Time-domain passivity (TDPN): velocity forth, the coupling's force back, control at both ports.

    Attributes:
        stiffness_n_per_m: K of the remote coupling, in the tip's scale [N/m].
        damping_ns_per_m: B of it [N s/m].
        damping_limit_ns_per_m: Largest damper of the controller on the handle, in the tip's scale [N s/m].
        mobility_limit_m_per_ns: Largest velocity per force that it takes off the command [m/(N s)].
        drift_gain_per_s: Pull of the integrated command to the master, as far as energy pays [1/s].
        drift_speed_m_per_s: Limit of that pull [m/s].
        follower: What the remote force drives.
    """

    type: Literal["time_domain"] = "time_domain"
    stiffness_n_per_m: NonNegativeFloat = 500.0
    damping_ns_per_m: NonNegativeFloat = 40.0
    damping_limit_ns_per_m: PositiveFloat = 400.0
    mobility_limit_m_per_ns: PositiveFloat = 0.01
    drift_gain_per_s: NonNegativeFloat = 5.0
    drift_speed_m_per_s: PositiveFloat = 0.05
    follower: FollowerConfig = FollowerConfig()

    def build(self, period_s: float, round_trip_s: float) -> BilateralScheme:
        """The scheme; it does not depend on the delay."""
        gains = numbers(TimeDomainLaw, self)
        law = gains[:LAW_SIZE].view(LAW)[0]
        law.control.damping_limit_ns_per_m = self.damping_limit_ns_per_m
        law.control.mobility_limit_m_per_ns = self.mobility_limit_m_per_ns
        return BilateralScheme(feel=feel, tell=tell, follow=follow, gains=gains, memory_size=MEMORY_SIZE)


class TimeDomainLaw(Record):
    """Numbers, as in `TimeDomainConfig`; `control` has the controllers' limits."""

    stiffness_n_per_m: float
    damping_ns_per_m: float
    drift_gain_per_s: float
    drift_speed_m_per_s: float
    control: PassivityLaw
    follower: FollowerLaw


class TimeDomainMemory(Record):
    """What an end remembers.

    Attributes:
        begun: Whether `reference` is set.
        before: Position before the handle moved (3,) [m].
        wanted: Force or velocity before the passivity controller (3,) [N] or [m/s].
        pull: Of the drift (3,) [m/s].
        reference: Integral of the commanded velocity (3,) [m].
        port: The passivity observer.
        follower: The follower.
    """

    SHAPES: ClassVar[dict[str, str]] = {name: "3" for name in ("before", "wanted", "pull", "reference")}
    begun: int
    before: Array
    wanted: Array
    pull: Array
    reference: Array
    port: PortEnergy
    follower: Follower


LAW, LAW_SIZE = overlay(TimeDomainLaw)
MEMORY, MEMORY_SIZE = overlay(TimeDomainMemory)


@compiled
def feel(gains: Array, end: End, memory: Array) -> int:
    """f_m = -f_s(t - T2) - beta v_m, beta from the observer of this port (`impedance_control`).

    Source: Ryu, Artigas, Preusche, Mechatronics 20(7), 2010; time-delay power network: Artigas, Ryu,
    Preusche, Hirzinger, IEEE/ASME Trans. Mechatron. 16(5), 2011.
    """
    law, known = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    for i in range(3):
        known.before[i] = end.position[i]
        known.wanted[i] = -end.trust * end.received[FORCE + i]
    impedance_control(law.control, known.port, known.wanted, end.velocity, end.period_s, end.command)
    return GOES_ON


@compiled
def tell(gains: Array, end: End, memory: Array) -> int:
    """Book what left the network at the handle and what the controller burnt; what entered is sent."""
    known, way = memory[:MEMORY_SIZE].view(MEMORY)[0], scratch(3)
    for i in range(3):
        way[i] = end.position[i] - known.before[i]
    tell_motion(end)
    work = dot(known.wanted, way)
    observe(known.port, work, work - end.work_j, end.received_j)
    end.energy_j, end.observed_j = max(-work, 0.0), observed(known.port)
    end.burnt_j = known.port.dissipated_j
    return GOES_ON


@compiled
def follow(gains: Array, end: End, memory: Array) -> int:
    """v_d = w v_m(t - T1) + pull - alpha f_s, alpha from this port's observer (`admittance_control`).

        f_s = K (x_d - x_s) + B (v_d - v_s),   x_d the integral of v_d

    The force f_s drives the follower and goes back: it is the coordinating force, which the follower takes
    alone, so that nothing feeds the motion forward past it.
    """
    law, known = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    force, velocity, period = scratch(3), scratch(3), end.period_s
    if known.begun == 0:
        known.begun = 1
        for i in range(3):
            known.reference[i] = end.position[i]
    for i in range(3):
        known.wanted[i] = end.trust * end.received[VELOCITY + i] if end.known != 0 else 0.0
        force[i] = law.stiffness_n_per_m * (known.reference[i] - end.position[i])
        force[i] += law.damping_ns_per_m * (known.wanted[i] - end.velocity[i])
        gap = end.received[POSITION + i] - known.reference[i] if end.known != 0 else 0.0
        known.pull[i] = end.trust * law.drift_gain_per_s * gap
    known.port.received_j += end.received_j
    compensate_drift(known.port, known.pull, force, period, law.drift_speed_m_per_s, known.wanted)
    admittance_control(law.control, known.port, known.wanted, force, period, velocity)
    work = period * dot(force, known.wanted)
    observe(known.port, work, work - period * dot(force, velocity), 0.0)
    for i in range(3):
        known.reference[i] += period * velocity[i]
        end.content[POSITION + i], end.content[VELOCITY + i] = end.position[i], end.velocity[i]
        end.content[FORCE + i] = force[i]
    end.energy_j, end.observed_j = max(-work, 0.0), observed(known.port)
    end.burnt_j = known.port.dissipated_j
    drive(law.follower, known.follower, end, force)
    return GOES_ON
