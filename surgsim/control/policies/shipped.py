"""Shipped policies: the simplest there are, as examples and as a baseline."""

from surgsim.array import Array
from surgsim.control.policies.observation import Observation

TIP_GAIN_PER_S = 5.0
DAMPING_NM_S_PER_RAD = 5.0


def proportional(observation: Observation) -> Array:
    """Tip velocity v = v_d - 5 (p - p_d) (3,) [m/s], eq. (20) of the VPRNN paper without the RCM."""
    return observation["command_velocity"] - TIP_GAIN_PER_S * observation["tip_error"]


def damping(observation: Observation) -> Array:
    """Torque tau = -5 q' (n,) [N m]: the arm comes to rest where it is."""
    return -DAMPING_NM_S_PER_RAD * observation["joint_velocity"]
