"""Joint impedance: what a position-controlled arm does with a resolver's output."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from surgsim.catalog import PartConfig
from surgsim.control.torque_laws.base import TorqueProblem
from surgsim.models.arm import ArmModel
from surgsim.models.config import Vec7

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

    def build(self, arm: ArmModel) -> "JointImpedance":
        """The law."""
        return JointImpedance(self)


class JointImpedance:
    """tau = K (q_ref - q) + D (q_ref' - q') + bias.

    The bias compensates gravity, Coriolis and centrifugal torque of the nominal model. The law knows neither
    tip nor trocar: their errors are what the joint errors make of them. Source: joint impedance mode of
    the LWR4+ (Albu-Schaeffer et al. 2007).
    """

    terms = ("joint", "bias")

    def __init__(self, config: JointImpedanceConfig) -> None:
        self._K = np.array(config.stiffness_nm_per_rad)
        self._D = np.array(config.damping_nm_s_per_rad)

    def start(self, problem: TorqueProblem) -> None:
        """The law has no state."""

    def torque(self, problem: TorqueProblem, memory: None) -> tuple[Array, None]:
        """Rows joint, bias (2, 7) [N m]."""
        p = problem
        joint = self._K * (p.q_ref - p.q) + self._D * (p.resolution.qdot - p.v)
        return np.stack((joint, p.dyn.bias)), None
