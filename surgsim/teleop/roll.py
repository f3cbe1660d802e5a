"""Roll of the instrument about its shaft, led by the turn of the grip about its axis."""

import math

from pydantic import NonNegativeFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.tick.arrays import Record


class RollConfig(PartConfig):
    """Whether the grip rolls the instrument, and how fast an error of the roll is drawn back.

    It goes one way: no torque about the shaft is shown to the operator, and the tanks book none.
    """

    use: bool = False
    gain_per_s: NonNegativeFloat = 2.0


class RollLaw(Record):
    """Numbers of the roll: as in `RollConfig`.

    Attributes:
        use: Whether the grip rolls the instrument.
        gain_per_s: k of `roll_rate`.
    """

    use: int
    gain_per_s: float


def describe_roll(law: RollLaw, config: RollConfig) -> None:
    """Fill the numbers."""
    law.use, law.gain_per_s = config.use, config.gain_per_s


@compiled
def turn_grip(upright: Array, angle: float, out: Array) -> None:
    """`upright` (3, 3) turned about its own first axis, the grip's, by `angle` [rad]; not in place."""
    c, s = math.cos(angle), math.sin(angle)
    for i in range(3):
        out[i, 0] = upright[i, 0]
        out[i, 1] = c * upright[i, 1] + s * upright[i, 2]
        out[i, 2] = c * upright[i, 2] - s * upright[i, 1]


@compiled
def rate_about(rotation: Array, axis: int, w: Array) -> float:
    """Turn about an axis of a frame, by number, at the angular velocity `w` (3,) [rad/s]."""
    rate: float = rotation[0, axis] * w[0] + rotation[1, axis] * w[1] + rotation[2, axis] * w[2]
    return rate


@compiled
def roll_rate(law: RollLaw, trust: float, wanted_rate: float, wanted: float, roll: float) -> float:
    """w_d = trust (w + k (phi - phi_r)) [rad/s], with rate w and roll phi as received.

    The second term keeps lost packets from adding up to an offset.
    """
    if not law.use:
        return 0.0
    return trust * (wanted_rate + law.gain_per_s * (wanted - roll))
