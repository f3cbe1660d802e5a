"""Soft tissue that the tip presses on and drags through."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import mujoco
import numpy as np
from pydantic import Field, model_validator

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.models.config import Vec3
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig, Spread, spread_factor
from surgsim.plant.explicit import FADE_M, check_step, needs_instrument, pressure
from surgsim.spatial import unit
from surgsim.tick.algebra import dot
from surgsim.tick.arrays import World
from surgsim.tick.mujoco_calls import mj_objectVelocity
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import push_at, site_place

_SITE = int(mujoco.mjtObj.mjOBJ_SITE)
POINT, NORMAL, LAW = slice(0, 3), slice(3, 6), slice(6, 9)
"""Gains: p_0 (3,) [m], n (3,), k, b, c (3,)."""


@compiled
def tissue_force(tip: Array, velocity: Array, point: Array, normal: Array, law: Array) -> Array:
    """Force of the tissue on the tip (3,) [N].

    At the depth p = n . (p_0 - p_WT) > 0 with velocity v, normal n and s = min(1, p / d_0):

        f = max(0, k p - b s n . v) n - c s (v - n (n . v))

    Args:
        tip: p_WT (3,) [m].
        velocity: v (3,) [m/s].
        point: A point p_0 of the plane (3,) [m].
        normal: n (3,).
        law: k, b, c (3,).
    """
    p = dot(normal, point - tip)
    if p <= 0.0:
        return np.zeros(3)
    share = min(1.0, p / FADE_M)
    rate = dot(normal, velocity)
    force: Array = pressure(p, -rate, law[0], law[1], 0.0) * normal - law[2] * share * (
        velocity - rate * normal
    )
    return force


@compiled
def press(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Add the force of the tissue, at the tip on the jaws."""
    tip = site_place(world, world.tip)
    if dot(gains[NORMAL], gains[POINT] - tip) <= 0.0:
        return GOES_ON
    moving = scratch(6)  # angular, then linear
    mj_objectVelocity(world.mj_model, world.mj_data, _SITE, world.tip, moving.ctypes.data, 0)
    force = tissue_force(tip, moving[3:], gains[POINT], gains[NORMAL], gains[LAW])
    push_at(world, world.jaws, tip, force)
    return GOES_ON


class TissueConfig(DisturbanceConfig):
    """Soft tissue below a plane, fixed in the world: stiff and damped along its normal, viscous across it.

    The stiffness is that of a flat punch of 8 mm diameter, 2 a E / (1 - nu^2), on incompressible tissue with
    E = 20 kPa: 213 N/m. Damping and drag are assumed.

    Attributes:
        point_m: A point of the plane, world frame [m].
        normal: Direction out of the tissue; any length but zero.
        stiffness_n_per_m: Along the normal [N/m].
        damping_n_s_per_m: Along the normal [N s/m].
        drag_n_s_per_m: Across the normal [N s/m].
        spread: Relative spread of all three over seeds.
    """

    type: Literal["tissue"] = "tissue"
    point_m: Vec3 = (0.0, 0.55, 0.025)
    normal: Vec3 = (0.0, 0.0, 1.0)
    stiffness_n_per_m: Annotated[float, Field(ge=0.0, le=20000.0)] = 200.0
    damping_n_s_per_m: Annotated[float, Field(ge=0.0, le=200.0)] = 2.0
    drag_n_s_per_m: Annotated[float, Field(ge=0.0, le=200.0)] = 5.0
    spread: Spread = 0.0

    @model_validator(mode="after")
    def _is_a_direction(self) -> "TissueConfig":
        if not any(self.normal):
            raise ValueError("tissue: normal must not be zero")
        return self

    def build(self, rng: np.random.Generator) -> "Tissue":
        """The disturbance, its stiffness, damping and drag drawn."""
        drawn = spread_factor(rng, self.spread, 3)
        law = drawn * (self.stiffness_n_per_m, self.damping_n_s_per_m, self.drag_n_s_per_m)
        return Tissue(np.array(self.point_m), unit(np.array(self.normal)), law)


class Tissue(Disturbance):
    """A spring that only pushes, with damping, and drag across it.

    The elastic part of `tissue_force` has the potential k p^2 / 2, the rest takes energy out; the tissue
    never pulls, and the force is continuous at touch. It acts at the tip on the jaws, whose sensor measures
    it. The tissue itself does not move, with the breath neither.

    Args:
        point: A point of the plane (3,) [m].
        normal: n (3,).
        law: k [N/m], b, c [N s/m] (3,).
    """

    touches_tip = True
    kernels: Mapping[str, Any] = {"push": press}

    def __init__(self, point: Array, normal: Array, law: Array) -> None:
        self.gains = np.concatenate((point, normal, law))

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Refuse a scene without an instrument."""
        needs_instrument(spec, "disturbance 'tissue'")

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Refuse a timestep that the tissue's law cannot be stepped with.

        Raises:
            SurgsimError: With what the tip bears.
        """
        k, b = float(self.gains[LAW][0]), float(self.gains[LAW][1:].max())
        check_step(scene, "disturbance 'tissue'", k, b, "damping_n_s_per_m or drag_n_s_per_m")
