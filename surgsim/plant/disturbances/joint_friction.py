"""Joint friction that the controller's model does not have."""

from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat

from surgsim.models.robot import JOINTS
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig, Spread, spread_factor


class JointFrictionConfig(DisturbanceConfig):
    """Coulomb and viscous friction of every joint.

    Attributes:
        coulomb_nm: Dry friction torque of each joint [N m].
        viscous_nm_s_per_rad: Viscous friction added to the model's own [N m s/rad].
        spread: Relative spread of both over seeds, drawn for each joint.
    """

    type: Literal["joint_friction"] = "joint_friction"
    coulomb_nm: NonNegativeFloat = 0.5
    viscous_nm_s_per_rad: NonNegativeFloat = 0.0

    spread: Spread = 0.0

    def build(self, rng: np.random.Generator) -> "JointFriction":
        """The disturbance, each joint's friction drawn."""
        return JointFriction(self, spread_factor(rng, self.spread, 7))


class JointFriction(Disturbance):
    """MuJoCo's dry joint friction (`frictionloss`, a constraint) and added damping.

    With MuJoCo's default constraint parameters a joint creeps at 3 mrad/s under 80 % of its friction torque;
    the ones here let it stick (0.3 urad/s).
    """

    def __init__(self, config: JointFrictionConfig, factors: NDArray[np.float64]) -> None:
        self._c = config
        self._factors = factors

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Set the joints' friction loss and add to their damping."""
        for name, factor in zip(JOINTS, self._factors, strict=True):
            joint = spec.joint(name)
            joint.frictionloss = factor * self._c.coulomb_nm
            joint.solimp_friction, joint.solref_friction = _STIFF_IMPEDANCE, _STIFF_REFERENCE
            damping = np.array(joint.damping, dtype=float)
            damping[0] += factor * self._c.viscous_nm_s_per_rad
            joint.damping = damping


_STIFF_IMPEDANCE = (0.9999, 0.9999, 0.001, 0.5, 2.0)
_STIFF_REFERENCE = (0.002, 1.0)
