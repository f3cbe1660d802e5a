"""Joint impedance: every joint a spring and damper about the resolver's reference."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.models.arm import ArmModel
from surgsim.models.config import Vec7
from surgsim.tick.arrays import Seen
from surgsim.tick.status import GOES_ON

Array = NDArray[np.float64]


class JointImpedanceConfig(PartConfig):
    """Stiffness and damping of every joint about the resolver's integrated reference.

    Attributes:
        stiffness_nm_per_rad: K, diagonal. The default is within what the LWR4+ offers (5000 at most).
        damping_nm_s_per_rad: D, diagonal.
    """

    type: Literal["joint_impedance"] = "joint_impedance"
    stiffness_nm_per_rad: Vec7 = (2000.0, 2000.0, 2000.0, 2000.0, 1000.0, 500.0, 200.0)
    damping_nm_s_per_rad: Vec7 = (60.0, 60.0, 40.0, 40.0, 15.0, 10.0, 6.0)

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law; gains K (n,), D (n,)."""
        gains = np.array([*self.stiffness_nm_per_rad, *self.damping_nm_s_per_rad])
        return KernelTorqueLaw(kernel=joint_impedance, arm=arm, terms=("joint", "bias"), gains=gains)


@compiled
def joint_impedance(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Tau = K (q_ref - q) + D (q_ref' - q') + bias; rows joint, bias (2, n) [N m].

    The bias compensates gravity, Coriolis and centrifugal torque of the nominal model. The law knows neither
    tip nor trocar: their errors are what the joint errors make of them. Source: joint impedance mode of
    the LWR4+ (Albu-Schaeffer et al. 2007).
    """
    n = seen.q.size
    for j in range(n):
        spring = gains[j] * (seen.q_ref[j] - seen.q[j])
        out[0, j] = spring + gains[n + j] * (seen.qdot_ref[j] - seen.v[j])
        out[1, j] = seen.bias[j]
    return GOES_ON
