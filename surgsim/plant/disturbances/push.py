"""A push on the instrument or the arm."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.models.config import Vec3
from surgsim.models.robot import link_names
from surgsim.plant.disturbances.base import Direction, Disturbance, DisturbanceConfig, pointed
from surgsim.plant.shaft import place_on_shaft
from surgsim.tick.arrays import World
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import body_place, push_at, site_place, site_turn

FORCE, START, LENGTH, RISE, BODY, SITE, DISTANCE = 0, 3, 4, 5, 6, 7, 8
"""Gains: force (3,) [N], its times [s], the body pushed, the site on whose axis or -1, from it back [m]."""


@compiled
def push_level(gains: Array, t_s: float) -> float:
    """Share of the force that acts at `t_s` [s]: raised cosine edges."""
    t = t_s - gains[START]
    edge = min(t, gains[LENGTH] - t) / gains[RISE]
    return 0.5 - 0.5 * math.cos(math.pi * min(edge, 1.0)) if edge > 0.0 else 0.0


@compiled
def push(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Add the force to that on the body that carries the point, with its moment."""
    level = push_level(gains, world.step_s)
    if level == 0.0:
        return GOES_ON
    body, site, force, point = int(gains[BODY]), int(gains[SITE]), scratch(3), scratch(3)
    for i in range(3):
        force[i] = level * gains[FORCE + i]
        if site < 0:
            point[i] = body_place(world, body)[i]
        else:
            point[i] = site_place(world, site)[i] - gains[DISTANCE] * site_turn(world, site)[3 * i + 2]
    push_at(world, body, point, force)
    return GOES_ON


class PushConfig(DisturbanceConfig):
    """A constant force for a while, with smooth edges, on the instrument or on a link's frame origin.

    Attributes:
        force_n: Force in the world frame [N].
        at: Where it acts: `tip`, `shaft` (a point of the shaft's axis), `elbow` (the link in the middle, the
            fourth of seven) or `wrist` (the last link but one).
        distance_m: Of that point of the shaft from its end [m]; without effect elsewhere.
        start_s: When it begins [s].
        duration_s: How long it lasts [s].
        rise_s: Time of each of its edges [s].
        direction: `given` as in force_n, or `random`: the same size, a direction drawn from the sphere.
    """

    type: Literal["push"] = "push"
    force_n: Vec3 = (5.0, 0.0, 0.0)
    at: Literal["tip", "shaft", "elbow", "wrist"] = "tip"
    distance_m: Annotated[float, Field(ge=0.0, le=1.0)] = 0.3
    start_s: NonNegativeFloat = 3.0
    duration_s: PositiveFloat = 3.0
    rise_s: Annotated[float, Field(gt=0.0, le=10.0)] = 0.05

    direction: Direction = "given"

    @property
    def begins_s(self) -> float:
        """When it first acts [s]."""
        return self.start_s

    def build(self, rng: np.random.Generator) -> "Push":
        """The disturbance, its direction drawn."""
        return Push(self, pointed(rng, np.array(self.force_n), self.direction))


class Push(Disturbance):
    """Pushes on the instrument or a link."""

    kernels: Mapping[str, Any] = {"push": push}

    def __init__(self, config: PushConfig, force: Array) -> None:
        self._c = config
        self.gains = np.array([*force, config.start_s, config.duration_s, config.rise_s, 0.0, -1.0, 0.0])

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Find the body that is pushed."""
        gains, at = self.gains, self._c.at
        if at in ("elbow", "wrist"):
            links = link_names(scene.dof_ids.size)
            gains[BODY] = int(scene.parts.body(links[(len(links) - 1) // 2 if at == "elbow" else -2]).id)
            return
        if at == "tip":
            gains[BODY], gains[SITE] = scene.model.site_bodyid[scene.tip_site], scene.tip_site
            return
        gains[BODY], gains[SITE], gains[DISTANCE] = place_on_shaft(scene, self._c.distance_m)
