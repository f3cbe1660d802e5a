"""The arm that schemes of forces drive: a mass and a damper, whose velocity the tip is given."""

from typing import ClassVar

from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.teleop.bilateral.base import End
from surgsim.teleop.messages import FORCE, POSITION, VELOCITY
from surgsim.tick.arrays import Record
from surgsim.tick.status import GOES_ON


class FollowerConfig(PartConfig):
    """Mass and damping of the follower, in the tip's scale; small ones follow well, and press unsteadily."""

    mass_kg: PositiveFloat = 2.0
    damping_ns_per_m: NonNegativeFloat = 5.0


class FollowerLaw(Record):
    """Numbers of the follower, as in `FollowerConfig`."""

    mass_kg: float
    damping_ns_per_m: float


class Follower(Record):
    """State of the follower.

    Attributes:
        velocity: v (3,) [m/s].
    """

    SHAPES: ClassVar[dict[str, str]] = {"velocity": "3"}
    velocity: Array


@compiled
def drive(law: FollowerLaw, follower: Follower, end: End, force: Array) -> None:
    """Move the follower under the scheme's force f and the force f_e of the tip; it is the tip's velocity.

        m v' = f - f_e - b v,   one step, implicit in b v

    Args:
        law: m and b.
        follower: v.
        end: Has f_e; `command` is filled.
        force: f (3,) [N].
    """
    share = end.period_s / law.mass_kg
    for i in range(3):
        pushed = follower.velocity[i] + share * (force[i] - end.force[i])
        follower.velocity[i] = pushed / (1.0 + share * law.damping_ns_per_m)
        end.command[i] = follower.velocity[i]


@compiled
def couple(end: End, stiffness: float, damping: float, out: Array) -> None:
    """Force of a spring and a damper to the other end as it is known here (3,) [N].

    f = w (K (x' - x) + B (v' - v)), with the trust w; nothing before anything is known.
    """
    for i in range(3):
        out[i] = 0.0
        if end.known != 0:
            out[i] = stiffness * (end.received[POSITION + i] - end.position[i])
            out[i] += damping * (end.received[VELOCITY + i] - end.velocity[i])
            out[i] *= end.trust


@compiled
def tell_motion(end: End) -> None:
    """Send position, velocity and force as they are, and no energy."""
    for i in range(3):
        end.content[POSITION + i] = end.position[i]
        end.content[VELOCITY + i] = end.velocity[i]
        end.content[FORCE + i] = end.force[i]
    end.energy_j = 0.0


@compiled
def tell(gains: Array, end: End, memory: Array) -> int:
    """The message of schemes that send no energy: position, velocity and force of the handle."""
    tell_motion(end)
    return GOES_ON
