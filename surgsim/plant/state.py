"""What the plant lets a controller see."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
NO_FORCE = np.zeros(3)
NO_FORCE.flags.writeable = False


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Measured state of the plant at a control tick. Arrays are the reader's own.

    Attributes:
        t_s: Time since the reset [s].
        q: Joint positions (n,) [rad].
        v: Joint velocities (n,) [rad/s].
        tau: Joint torques that the actuators gave over the last period (n,) [N m].
        p_WC: Trocar position, world frame (3,) [m]; NaN without a trocar.
        v_WC: Trocar velocity as announced to the controller (3,) [m/s]; zeros where nobody announces it.
        f_T: Force of the surroundings on the tip, as a sensor at the tip measures it, world frame (3,) [N].
    """

    t_s: float
    q: Array
    v: Array
    tau: Array
    p_WC: Array
    v_WC: Array
    f_T: Array = field(default_factory=lambda: NO_FORCE)
