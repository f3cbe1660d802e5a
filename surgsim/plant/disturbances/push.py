"""A push on the instrument or the arm."""

import math
from typing import Annotated, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.models.build import Scene
from surgsim.models.config import Vec3
from surgsim.plant.disturbances.base import Direction, Disturbance, DisturbanceConfig, pointed
from surgsim.spatial import cross

Array = NDArray[np.float64]


class PushConfig(DisturbanceConfig):
    """A constant force for a while, with smooth edges, on the instrument or on a link's frame origin.

    Attributes:
        force_n: Force in the world frame [N].
        at: Where it acts: `tip`, `shaft` (a point of the shaft's axis), `elbow` (link 4) or `wrist` (link 6).
        distance_m: Of that point of the shaft from the tip [m]; without effect elsewhere.
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
    """Adds the force to `xfrc_applied` of the body that carries the point, with its moment."""

    def __init__(self, config: PushConfig, force: Array) -> None:
        self._c = config
        self._force = force

    def push(self, t_s: float, scene: Scene, data: mujoco.MjData) -> None:
        """Add the force at `t_s` [s]."""
        level = self.level(t_s)
        if level == 0.0:
            return
        body, point = self._place(scene, data)
        force = level * self._force
        data.xfrc_applied[body, :3] += force
        data.xfrc_applied[body, 3:] += cross(point - data.xipos[body], force)

    def level(self, t_s: float) -> float:
        """Share of the force that acts at `t_s` [s]: raised cosine edges."""
        t = t_s - self._c.start_s
        edge = min(t, self._c.duration_s - t) / self._c.rise_s
        return 0.5 - 0.5 * math.cos(math.pi * min(edge, 1.0)) if edge > 0.0 else 0.0

    def _place(self, scene: Scene, data: mujoco.MjData) -> tuple[int, Array]:
        """The body that is pushed, and the point (3,) [m]."""
        tip = scene.tip_site
        if self._c.at == "tip":
            return int(scene.model.site_bodyid[tip]), data.site_xpos[tip]
        if self._c.at == "shaft":
            point = data.site_xpos[tip] - self._c.distance_m * data.site_xmat[tip, 2::3]
            return int(scene.model.site_bodyid[tip]), point
        body = int(scene.model.body({"elbow": "link4", "wrist": "link6"}[self._c.at]).id)
        return body, data.xpos[body]
