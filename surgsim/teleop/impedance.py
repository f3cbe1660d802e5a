"""The hand on the handle: a spring and damper between where it is meant to be and where it is."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from surgsim.teleop.console import ConsoleState

Array = NDArray[np.float64]


class Grip(Protocol):
    """Stiffness and damping of the hand; `OperatorConfig` has them."""

    @property
    def stiffness_n_per_m(self) -> float:
        """K."""
        ...

    @property
    def damping_ns_per_m(self) -> float:
        """D."""
        ...

    @property
    def turn_stiffness_nm_per_rad(self) -> float:
        """K_R."""
        ...

    @property
    def turn_damping_nms_per_rad(self) -> float:
        """D_R."""
        ...


def hand_wrench(grip: Grip, position: Array, velocity: Array, upright: Array, handle: ConsoleState) -> Array:
    """Force and torque of the hand on the handle in O (6,) [N, N m].

        F = K (x - x_o) + D (v - v_o),   M = -K_R theta - D_R w_o

    Args:
        grip: K, D, K_R, D_R.
        position: x, where the hand is meant to be (3,) [m].
        velocity: v, how it is meant to move (3,) [m/s].
        upright: Orientation that the hand keeps (3, 3); theta is the turn away from it.
        handle: The console.
    """
    wrench = np.empty(6)
    wrench[:3] = grip.stiffness_n_per_m * (position - handle.position)
    wrench[:3] += grip.damping_ns_per_m * (velocity - handle.velocity)
    R = handle.rotation @ upright.T
    turned = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    wrench[3:] = -grip.turn_stiffness_nm_per_rad * turned
    wrench[3:] -= grip.turn_damping_nms_per_rad * handle.angular_velocity
    return wrench
