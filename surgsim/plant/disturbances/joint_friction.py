"""Joint friction that the controller's model does not have."""

from typing import Literal

import mujoco
import numpy as np
from pydantic import NonNegativeFloat

from surgsim.catalog import PartConfig
from surgsim.models.robot import JOINTS
from surgsim.plant.disturbances.base import Disturbance


class JointFrictionConfig(PartConfig):
    """Coulomb and viscous friction of every joint.

    Attributes:
        coulomb_nm: Dry friction torque of each joint [N m].
        viscous_nm_s_per_rad: Viscous friction added to the model's own [N m s/rad].
    """

    type: Literal["joint_friction"] = "joint_friction"
    coulomb_nm: NonNegativeFloat = 0.5
    viscous_nm_s_per_rad: NonNegativeFloat = 0.0

    def build(self) -> "JointFriction":
        """The disturbance."""
        return JointFriction(self)


class JointFriction(Disturbance):
    """MuJoCo's dry joint friction (`frictionloss`, a constraint: it sticks) and added damping."""

    def __init__(self, config: JointFrictionConfig) -> None:
        self._c = config

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Set the joints' friction loss and add to their damping."""
        for name in JOINTS:
            joint = spec.joint(name)
            joint.frictionloss = self._c.coulomb_nm
            damping = np.array(joint.damping, dtype=float)
            damping[0] += self._c.viscous_nm_s_per_rad
            joint.damping = damping
