"""Joint impedance: every joint a spring and damper about the resolver's reference."""

from typing import Literal

import numpy as np
from pydantic import PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.torque_laws.base import KernelTorqueLaw, for_joints
from surgsim.models.arm import ArmModel
from surgsim.models.config import PerJoint
from surgsim.tick.arrays import Seen
from surgsim.tick.status import GOES_ON

STIFFNESS = (2000.0, 2000.0, 2000.0, 2000.0, 1000.0, 500.0, 200.0)
"""From base to flange [N m/rad]; torque-controlled arms offer up to 5000."""
DAMPING = (60.0, 60.0, 40.0, 40.0, 15.0, 10.0, 6.0)
"""From base to flange [N m s/rad]."""


class JointImpedanceConfig(PartConfig):
    """Stiffness and damping of every joint about the resolver's integrated reference.

    Attributes:
        stiffness_nm_per_rad: K, diagonal; null: from 2000 at the base to 200 at the flange, read off at the
            arm's joints, within what torque-controlled arms offer (5000 at most).
        damping_nm_s_per_rad: D, diagonal; null: likewise, from 60 to 6.
        stiffness_factor: K is so many times that.
        damping_factor: D is so many times that.
    """

    type: Literal["joint_impedance"] = "joint_impedance"
    stiffness_nm_per_rad: PerJoint | None = None
    damping_nm_s_per_rad: PerJoint | None = None
    stiffness_factor: PositiveFloat = 1.0
    damping_factor: PositiveFloat = 1.0

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law; gains K (n,), D (n,).

        Raises:
            SurgsimError: If a list has not a number for each joint.
        """
        n = arm.limits.q_min.size
        stiffness = for_joints("stiffness_nm_per_rad", self.stiffness_nm_per_rad, STIFFNESS, n)
        damping = for_joints("damping_nm_s_per_rad", self.damping_nm_s_per_rad, DAMPING, n)
        gains = np.concatenate((self.stiffness_factor * stiffness, self.damping_factor * damping))
        return KernelTorqueLaw(kernel=joint_impedance, arm=arm, terms=("joint", "bias"), gains=gains)


@compiled
def joint_impedance(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Tau = K (q_ref - q) + D (q_ref' - q') + bias; rows joint, bias (2, n) [N m].

    The bias compensates gravity, Coriolis and centrifugal torque of the nominal model. The law knows neither
    tip nor trocar: their errors are what the joint errors make of them. Source: the joint
    impedance mode of DLR's light-weight arms (Albu-Schaeffer et al. 2007).
    """
    n = seen.q.size
    for j in range(n):
        spring = gains[j] * (seen.q_ref[j] - seen.q[j])
        out[0, j] = spring + gains[n + j] * (seen.qdot_ref[j] - seen.v[j])
        out[1, j] = seen.bias[j]
    return GOES_ON
