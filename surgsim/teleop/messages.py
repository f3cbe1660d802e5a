"""What the two sides tell each other."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
PassivityMode = Literal["tank", "tdpa", "off"]


@dataclass(frozen=True, kw_only=True, slots=True)
class OperatorMessage:
    """From the operator to the remote side, in remote world axes.

    Attributes:
        position: Tip position that the handle stands for (3,) [m].
        velocity: Tip velocity that the handle stands for (3,) [m/s].
        jaw: Closing of the jaws, 0 to 1.
    """

    position: Array
    velocity: Array
    jaw: float


@dataclass(frozen=True, kw_only=True, slots=True)
class RemoteMessage:
    """From the remote to the operator side, in remote world axes.

    Attributes:
        position: Tip position, also what the screen shows (3,) [m].
        force: Force of the tip on its environment (3,) [N]; shown, not used by the force law.
    """

    position: Array
    force: Array
