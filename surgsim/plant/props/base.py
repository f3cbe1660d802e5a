"""What every prop has, and the instrument's tip as a thing that touches."""

import mujoco
import numpy as np

from surgsim.plant.part import PlantPart

TIP_GEOM = "tip_contact"
TIP_CONTACT_BIT = 2
"""Bit of `contype` and `conaffinity` of the tip and of the props that it meets."""


class Prop(PlantPart):
    """A thing in the patient that the instrument's tip can touch."""

    touches_tip = True


def contact_tip(spec: mujoco.MjSpec, radius_m: float = 0.002) -> None:
    """Give the jaws a sphere that touches props, once, with its pole at the tip."""
    jaws = spec.body("jaws")
    if any(geom.name == TIP_GEOM for geom in jaws.geoms):
        return
    jaws.add_geom(
        name=TIP_GEOM,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[radius_m, 0, 0],
        pos=np.array([0.0, 0.0, -radius_m]),
        mass=0.0,
        contype=TIP_CONTACT_BIT,
        conaffinity=0,
        group=3,
        material="",  # the jaws' class names one that the attached model calls otherwise
    )
