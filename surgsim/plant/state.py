"""What the plant lets a controller see."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Measured state of the plant at a control tick. Arrays are the reader's own.

    Attributes:
        t_s: Time since the reset [s].
        q: Joint positions (7,) [rad].
        v: Joint velocities (7,) [rad/s].
        tau: Joint torques that the actuators gave over the last period (7,) [N m].
        p_WC: Trocar position, world frame (3,) [m]; NaN without a trocar.
        v_WC: Trocar velocity (3,) [m/s]; zeros without a trocar.
    """

    t_s: float
    q: Array
    v: Array
    tau: Array
    p_WC: Array
    v_WC: Array
