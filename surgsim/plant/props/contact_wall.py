"""A flat wall in front of the tip: bone, a stiff organ, or a soft one."""

from collections.abc import Mapping
from typing import Any, Literal

import mujoco
import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.models.config import Vec3
from surgsim.plant.explicit import check_step, needs_instrument, pressure
from surgsim.plant.props.base import Prop
from surgsim.spatial import unit
from surgsim.tick.algebra import dot, norm
from surgsim.tick.arrays import World
from surgsim.tick.mujoco_calls import mj_objectVelocity
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import push_at, site_place

AHEAD_STEPS = 0.2
"""How far ahead the spring is read, in physics steps. The least that keeps a sampled spring from giving out
energy at every speed, every phase of the step and every stiffness that `check_step` lets through."""
CREEP_N_S_PER_M = 100.0
"""Friction below sliding is a damper of this size."""
_SITE = int(mujoco.mjtObj.mjOBJ_SITE)
POINT, NORMAL, ACROSS = slice(0, 3), slice(3, 6), slice(6, 12)
STIFFNESS, DAMPING, FRICTION, HALF_SIZE = range(12, 16)
"""Gains: p_0 (3,) [m], n (3,), the two edges' directions (6,), k, b, mu, half an edge [m]."""
OUTSIDE, PRESSED, PAST = 0.0, 1.0, 2.0
"""Memory: where the tip is: in front of the face; in contact; or behind without having come through it."""


class ContactWallConfig(PartConfig):
    """A flat wall that the tip can press on.

    Attributes:
        point_m: A point of its face, world frame [m].
        normal: Direction out of the wall, towards the tip; any length but zero.
        stiffness_n_per_m: Along the normal [N/m].
        damping_n_s_per_m: Along the normal [N s/m].
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

    @model_validator(mode="after")
    def _is_a_direction(self) -> "ContactWallConfig":
        if not any(self.normal):
            raise ValueError("contact_wall: normal must not be zero")
        return self

    def build(self, rng: np.random.Generator) -> "ContactWall":
        """The prop."""
        return ContactWall(self)


@compiled
def wall_force(gains: Array, depth: float, velocity: Array, timestep_s: float, out: Array) -> None:
    """Fill `out` with the force of the wall on the tip (3,) [N] at a depth p > 0 with velocity v.

        f   = max(0, k (p + 0.2 h p') + b min(1, p / d_0) p'),   p' = -n . v
        f_t = -min(mu f / |v_t|, c) v_t,                         v_t = v - n (n . v)

    with the physics step h. Its look ahead adds the damping 0.2 k h, 4 N s/m of 20 kN/m at 1 ms: without it a
    spring that is sampled gives out up to 13 % of the energy it took. Friction is Coulomb's, with a damper c
    in the place of sticking; it takes energy at every instant.

    Args:
        gains: See `POINT` and the following.
        depth: p [m].
        velocity: v of the tip (3,) [m/s].
        timestep_s: h [s].
        out: Filled.
    """
    normal, rate = gains[NORMAL], dot(gains[NORMAL], velocity)
    f = pressure(depth, -rate, gains[STIFFNESS], gains[DAMPING], AHEAD_STEPS * timestep_s)
    for i in range(3):
        out[i] = velocity[i] - rate * normal[i]
    sliding = norm(out)
    drag = CREEP_N_S_PER_M if sliding * CREEP_N_S_PER_M < gains[FRICTION] * f else 0.0
    if drag == 0.0 and sliding > 0.0:
        drag = gains[FRICTION] * f / sliding
    for i in range(3):
        out[i] = f * normal[i] - drag * out[i]


@compiled
def where(gains: Array, tip: Array, before: float) -> float:
    """Where the tip (3,) [m] is, given where it was: `OUTSIDE`, `PRESSED` or `PAST`.

    A contact begins where the tip comes through the face, and ends where it comes out or gets past an edge: a
    tip that comes in from the side, or is behind the face at first, meets no force that no work has built up.
    """
    away = scratch(3)
    for i in range(3):
        away[i] = tip[i] - gains[i]
    if dot(gains[NORMAL], away) >= 0.0:
        return OUTSIDE
    x, y = dot(gains[6:9], away), dot(gains[9:12], away)
    if before == PAST or max(abs(x), abs(y)) > gains[HALF_SIZE]:
        return PAST
    return PRESSED


@compiled
def press(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Add the force of the wall, at the tip on the jaws."""
    tip = site_place(world, world.tip)
    memory[0] = where(gains, tip, memory[0])
    if memory[0] != PRESSED:
        return GOES_ON
    depth = 0.0
    for i in range(3):
        depth += gains[3 + i] * (gains[i] - tip[i])
    moving, force = scratch(6), scratch(3)  # angular, then linear
    mj_objectVelocity(world.mj_model, world.mj_data, _SITE, world.tip, moving.ctypes.data, 0)
    wall_force(gains, depth, moving[3:], world.timestep_s, force)
    push_at(world, world.jaws, tip, force)
    return GOES_ON


class ContactWall(Prop):
    """A fixed wall whose face presses the tip back by `wall_force`; a box shows it.

    MuJoCo's own contact would not do: it makes energy in an impact, and its force is no spring. The force
    acts at the tip on the jaws, whose sensor measures it; no other part of the instrument feels the wall.
    """

    kernels: Mapping[str, Any] = {"push": press}
    memory = np.array([PAST])

    _THICKNESS_M = 0.01

    def __init__(self, config: ContactWallConfig) -> None:
        self._c, normal = config, unit(np.array(config.normal))
        self._quat, turn = np.zeros(4), np.zeros(9)
        mujoco.mju_quatZ2Vec(self._quat, normal)
        mujoco.mju_quat2Mat(turn, self._quat)
        edges = turn.reshape(3, 3).T[:2].ravel()
        law = config.stiffness_n_per_m, config.damping_n_s_per_m, config.friction, 0.5 * config.size_m
        self.gains = np.concatenate((config.point_m, normal, edges, law))

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Add the box that is seen; nothing collides with it."""
        needs_instrument(spec, "prop 'contact_wall'")
        half = float(self.gains[HALF_SIZE])
        spec.worldbody.add_geom(
            name="contact_wall",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[half, half, self._THICKNESS_M / 2],
            pos=self.gains[POINT] - 0.5 * self._THICKNESS_M * self.gains[NORMAL],
            quat=self._quat,
            contype=0,
            conaffinity=0,
            rgba=[0.86, 0.72, 0.55, 1.0],
        )

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Refuse a timestep that the wall's law cannot be stepped with.

        Raises:
            SurgsimError: With what the tip bears.
        """
        c = self._c
        damping, key = c.damping_n_s_per_m, "damping_n_s_per_m"
        if c.friction > 0.0 and damping < CREEP_N_S_PER_M:
            damping, key = CREEP_N_S_PER_M, "friction's damping"
        check_step(scene, "prop 'contact_wall'", c.stiffness_n_per_m, damping, key)
