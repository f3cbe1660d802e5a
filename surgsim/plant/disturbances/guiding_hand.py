"""A hand on the instrument's adapter that leads it along a line."""

from typing import Annotated, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.models.build import Scene
from surgsim.models.config import Vec3
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig
from surgsim.teleop.tremor import Tremor, TremorConfig

Array = NDArray[np.float64]
GRIP_S = 0.5
"""Time over which the grip closes and opens [s]."""


class GuidingHandConfig(DisturbanceConfig):
    """A hand that holds the adapter by a spring and moves along a line, with tremor.

    Attributes:
        travel_m: Where the hand goes from where it took hold, world axes [m].
        start_s: When it begins to move; it takes hold half a second before, or at once [s].
        duration_s: How long it moves, as minimum jerk [s].
        stay_s: How long it stays before it lets go [s].
        stiffness_n_per_m: Of its grip [N/m].
        damping_n_s_per_m: Of its grip [N s/m].
        force_max_n: Largest force that it pulls with [N].
        tremor: Of the hand.
    """

    type: Literal["guiding_hand"] = "guiding_hand"
    travel_m: Vec3 = (0.0, 0.0, -0.15)
    start_s: NonNegativeFloat = 0.5
    duration_s: PositiveFloat = 6.0
    stay_s: NonNegativeFloat = 0.5
    stiffness_n_per_m: PositiveFloat = 300.0
    damping_n_s_per_m: NonNegativeFloat = 10.0
    force_max_n: Annotated[float, Field(gt=0.0, le=200.0)] = 20.0
    tremor: TremorConfig = TremorConfig()

    @property
    def begins_s(self) -> float:
        """When it takes hold [s]."""
        return max(0.0, self.start_s - GRIP_S)

    def build(self, rng: np.random.Generator) -> "GuidingHand":
        """The disturbance."""
        return GuidingHand(self)


class GuidingHand(Disturbance):
    """F = K (p_hand - p) + D (p_hand' - p') at the end of the adapter, at most force_max_n.

    p_hand = p_0 + s(t) travel + tremor, s(x) = 10 x^3 - 15 x^4 + 6 x^5 (minimum jerk; Flash and Hogan 1985).
    The grip closes and opens over `GRIP_S`.
    """

    def __init__(self, config: GuidingHandConfig) -> None:
        self._c = config
        self._travel = np.array(config.travel_m)
        self._begun: Array | None = None

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Let go, with a tremor of its own generator."""
        self._begun = None
        self._tremor = Tremor(self._c.tremor, float(scene.model.opt.timestep), rng)

    def push(self, t_s: float, scene: Scene, data: mujoco.MjData) -> None:
        """Pull at the adapter at `t_s` [s]."""
        offset, shake = self._tremor.step()
        grip = self.grip_at(t_s)
        if grip == 0.0:
            return
        site = scene.shaft_entry_site
        place, body = np.array(data.site_xpos[site]), int(scene.model.site_bodyid[site])
        if self._begun is None:
            self._begun = place
        moving = np.zeros(6)
        mujoco.mj_objectVelocity(scene.model, data, mujoco.mjtObj.mjOBJ_SITE, site, moving, 0)
        s, rate = self._progress(t_s)
        gap = self._begun + s * self._travel + offset - place
        force = self._c.stiffness_n_per_m * gap
        force += self._c.damping_n_s_per_m * (rate * self._travel + shake - moving[3:])
        force *= grip * min(1.0, self._c.force_max_n / max(float(np.linalg.norm(force)), 1e-12))
        data.xfrc_applied[body, :3] += force
        data.xfrc_applied[body, 3:] += np.cross(place - data.xipos[body], force)

    def grip_at(self, t_s: float) -> float:
        """How closed the hand is, from 0 to 1."""
        closed = (t_s - self._c.start_s) / GRIP_S + 1.0
        opened = (self._c.start_s + self._c.duration_s + self._c.stay_s - t_s) / GRIP_S + 1.0
        return float(min(max(min(closed, opened), 0.0), 1.0))

    def _progress(self, t_s: float) -> tuple[float, float]:
        """Share of the way, and its rate [1/s]."""
        x = min(max((t_s - self._c.start_s) / self._c.duration_s, 0.0), 1.0)
        rate = 30.0 * x * x * (1.0 - x) ** 2 / self._c.duration_s
        return x**3 * (10.0 - 15.0 * x + 6.0 * x * x), rate
