"""Two layers: one that wants to be transparent, and one that pays for it from tanks."""

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
    couple,
    drive,
    tell_motion,
)
from surgsim.teleop.tank import affordable
from surgsim.tick.algebra import dot
from surgsim.tick.arrays import Record
from surgsim.tick.overlay import overlay
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON


class TwoLayerConfig(PartConfig):
    """Two layers: position-position on top, and below it tanks that pay for every force.

    The hand fills its own tank through a damper, and each tank sends a share of what it holds.

    Attributes:
        initial_j: What each tank holds at first [J].
        stiffness_n_per_m: K of the transparency layer, in the tip's scale [N/m].
        damping_ns_per_m: B of it [N s/m].
        target_j: H_d, what the operator's tank is filled to [J].
        refill_damping_ns_per_mj: alpha, the damper on the handle per joule that its tank lacks [N s/(m J)].
        refill_most_ns_per_m: Largest such damper [N s/m].
        send_time_s: A tank sends its content with this time constant [s].
        follower: What the remote force drives.
    """

    type: Literal["two_layer"] = "two_layer"
    stiffness_n_per_m: NonNegativeFloat = 240.0
    damping_ns_per_m: NonNegativeFloat = 20.0
    initial_j: NonNegativeFloat = 0.2
    target_j: PositiveFloat = 0.2
    refill_damping_ns_per_mj: NonNegativeFloat = 200.0
    refill_most_ns_per_m: NonNegativeFloat = 40.0
    send_time_s: PositiveFloat = 0.2
    follower: FollowerConfig = FollowerConfig()

    def build(self, period_s: float, round_trip_s: float) -> BilateralScheme:
        """The scheme; it does not depend on the delay."""
        gains = numbers(TwoLayerLaw, self)
        return BilateralScheme(feel=feel, tell=tell, follow=follow, gains=gains, memory_size=MEMORY_SIZE)


class TwoLayerLaw(Record):
    """Numbers, as in `TwoLayerConfig`."""

    stiffness_n_per_m: float
    damping_ns_per_m: float
    initial_j: float
    target_j: float
    refill_damping_ns_per_mj: float
    refill_most_ns_per_m: float
    send_time_s: float
    follower: FollowerLaw


class TwoLayerMemory(Record):
    """What an end remembers.

    Attributes:
        begun: Whether the tank is filled and `position` known.
        tank_j: H [J].
        position: Of the tip at the last period (3,) [m].
        force: On the follower over the last period (3,) [N].
        follower: The follower.
    """

    SHAPES: ClassVar[dict[str, str]] = {"position": "3", "force": "3"}
    begun: int
    tank_j: float
    position: Array
    force: Array
    follower: Follower


LAW, LAW_SIZE = overlay(TwoLayerLaw)
MEMORY, MEMORY_SIZE = overlay(TwoLayerMemory)


@compiled
def _book(law: TwoLayerLaw, known: TwoLayerMemory, end: End, work_j: float) -> None:
    """H+ = H + E_in - W - E_out,   E_out = H h / t_send."""
    after = known.tank_j + end.received_j - work_j
    end.deficit_j += max(-after, 0.0)
    known.tank_j = max(after, 0.0)
    end.energy_j = known.tank_j * min(end.period_s / law.send_time_s, 1.0)
    known.tank_j -= end.energy_j
    end.stored_j = end.observed_j = known.tank_j


@compiled
def feel(gains: Array, end: End, memory: Array) -> int:
    """f_m = k C (x_s(t - T2) - x_m) - d v_m,   d = min(alpha max(H_d - H, 0), d_max).

    k is the largest share of the upper layer's force, at most 1, that the tank can pay for in this period,
    with what the force adds by accelerating the handle. The damper is the tank-level controller at this end.

    Source: Franken, Stramigioli, Misra, Secchi, Macchelli, IEEE Trans. Robot. 27(4), 2011, sections III to V.
    """
    law, known = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    if known.begun == 0:
        known.begun, known.tank_j = 1, law.initial_j
    couple(end, law.stiffness_n_per_m, law.damping_ns_per_m, end.command)
    period = end.period_s
    damping = law.refill_damping_ns_per_mj * max(law.target_j - known.tank_j, 0.0)
    damping = min(damping, law.refill_most_ns_per_m)
    work = period * dot(end.command, end.velocity)
    own = 0.5 * period * period * end.mobility_per_kg * dot(end.command, end.command)
    share = affordable(work, own, known.tank_j)
    for i in range(3):
        end.command[i] = share * end.command[i] - damping * end.velocity[i]
    return GOES_ON


@compiled
def tell(gains: Array, end: End, memory: Array) -> int:
    """Book the work of the rendered force; motion and energy go to the other end."""
    law, known = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    tell_motion(end)
    _book(law, known, end, end.work_j)
    return GOES_ON


@compiled
def follow(gains: Array, end: End, memory: Array) -> int:
    """f_s = k C (x_m(t - T1) - x_s), on the follower, as far as the tank pays; its work on the tip is booked.

    k as in `feel`, with the follower's mass.
    """
    law, known = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    force, work = scratch(3), 0.0
    if known.begun == 0:
        known.begun, known.tank_j = 1, law.initial_j
        for i in range(3):
            known.position[i] = end.position[i]
    for i in range(3):
        work += known.force[i] * (end.position[i] - known.position[i])
    tell_motion(end)
    _book(law, known, end, work)
    couple(end, law.stiffness_n_per_m, law.damping_ns_per_m, force)
    period = end.period_s
    own = 0.5 * period * period * dot(force, force) / law.follower.mass_kg
    share = affordable(period * dot(force, end.velocity), own, known.tank_j)
    for i in range(3):
        force[i] *= share
        known.force[i], known.position[i] = force[i], end.position[i]
    drive(law.follower, known.follower, end, force)
    return GOES_ON
