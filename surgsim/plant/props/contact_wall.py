"""A flat wall in front of the tip: bone, a stiff organ, or a soft one."""

from typing import Literal

import mujoco
import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.models.config import Vec3
from surgsim.plant.props.base import TIP_CONTACT_BIT, Prop, contact_tip
from surgsim.spatial import unit


class ContactWallConfig(PartConfig):
    """A flat wall that the tip can press on.

    Attributes:
        point_m: A point of its face, world frame [m].
        normal: Direction out of the wall, towards the tip.
        stiffness_n_per_m: Contact stiffness, for one kilogram of effective mass at the tip [N/m].
        damping_n_s_per_m: Contact damping, likewise [N s/m].
        friction: Coefficient of sliding friction.
        size_m: Edge length of the drawn face; the wall ends there [m].
    """

    type: Literal["contact_wall"] = "contact_wall"
    point_m: Vec3 = (0.0, 0.65, -0.06)
    normal: Vec3 = (0.0, 0.0, 1.0)
    stiffness_n_per_m: PositiveFloat = 20000.0
    damping_n_s_per_m: NonNegativeFloat = 100.0
    friction: NonNegativeFloat = 0.0
    size_m: PositiveFloat = 0.2

    def build(self, rng: np.random.Generator) -> "ContactWall":
        """The prop."""
        return ContactWall(self)


class ContactWall(Prop):
    """A fixed box whose face is the wall."""

    _THICKNESS_M = 0.01

    def __init__(self, config: ContactWallConfig) -> None:
        self._c = config

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Add the box and the tip's contact sphere."""
        c, quat = self._c, np.zeros(4)
        normal = unit(np.array(c.normal))
        mujoco.mju_quatZ2Vec(quat, normal)
        contact_tip(spec)
        spec.worldbody.add_geom(
            name="contact_wall",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[c.size_m / 2, c.size_m / 2, self._THICKNESS_M / 2],
            pos=np.array(c.point_m) - 0.5 * self._THICKNESS_M * normal,
            quat=quat,
            contype=0,
            conaffinity=TIP_CONTACT_BIT,
            friction=[c.friction, 0.0, 0.0],
            condim=3 if c.friction else 1,
            priority=1,
            solref=[-c.stiffness_n_per_m, -c.damping_n_s_per_m],
            solimp=[0.99, 0.99, 0.001, 0.5, 2.0],
            rgba=[0.86, 0.72, 0.55, 1.0],
        )
