"""The hand on the handle: a spring and damper between where it is meant to be and where it is."""

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.teleop.console import ConsoleState
from surgsim.tick.arrays import Record


class Grip(Record):
    """Stiffness and damping of the hand.

    Attributes:
        stiffness_n_per_m: K.
        damping_ns_per_m: D.
        turn_stiffness_nm_per_rad: K_R.
        turn_damping_nms_per_rad: D_R.
    """

    stiffness_n_per_m: float
    damping_ns_per_m: float
    turn_stiffness_nm_per_rad: float
    turn_damping_nms_per_rad: float


@compiled
def hand_wrench(
    grip: Grip, position: Array, velocity: Array, upright: Array, handle: ConsoleState, out: Array
) -> None:
    """Force and torque of the hand on the handle in O (6,) [N, N m].

        F = K (x - x_o) + D (v - v_o),   M = -K_R theta - D_R w_o

    Args:
        grip: K, D, K_R, D_R.
        position: x, where the hand is meant to be (3,) [m].
        velocity: v, how it is meant to move (3,) [m/s].
        upright: Orientation that the hand keeps (3, 3); theta is the turn away from it.
        handle: The console.
        out: Filled with force and torque.
    """
    for i in range(3):
        out[i] = grip.stiffness_n_per_m * (position[i] - handle.position[i])
        out[i] += grip.damping_ns_per_m * (velocity[i] - handle.velocity[i])
        a, b = (i + 1) % 3, (i + 2) % 3  # theta_i = (R_ba - R_ab) / 2 of R = R_o upright^T
        turned = 0.0
        for k in range(3):
            turned += handle.rotation[b, k] * upright[a, k] - handle.rotation[a, k] * upright[b, k]
        out[3 + i] = -grip.turn_stiffness_nm_per_rad * (0.5 * turned)
        out[3 + i] -= grip.turn_damping_nms_per_rad * handle.angular_velocity[i]
