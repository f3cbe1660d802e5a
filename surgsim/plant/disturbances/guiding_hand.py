"""A hand on the instrument's adapter that leads it along a line."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import mujoco
import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.models.config import Vec3
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig
from surgsim.plant.part import BLOCK_TICKS
from surgsim.teleop.tremor import TremorConfig, resonance, shake
from surgsim.tick.algebra import norm
from surgsim.tick.arrays import World
from surgsim.tick.mujoco_calls import mj_objectVelocity
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import push_at, site_place

GRIP_S = 0.5
"""Time over which the grip closes and opens [s]."""


_SITE = int(mujoco.mjtObj.mjOBJ_SITE)
TRAVEL, START, LENGTH, STAY, STIFFNESS, DAMPING, MOST, A1, A2, BODY = 0, 3, 4, 5, 6, 7, 8, 9, 10, 11
"""Gains: travel (3,) [m], times [s], K, D, force_max_n, those of `shake`, the body of the shaft's entry."""
HOLDS, PLACE, LAST, BEFORE, USED, NOISE = 0, 1, 4, 7, 10, 11
"""Memory: whether and where it took hold (3,) [m], tremor now and before (3,) [m], noise used, noise."""


@compiled
def grip_at(gains: Array, t_s: float) -> float:
    """How closed the hand is, from 0 to 1: it closes and opens over `GRIP_S`."""
    closed = (t_s - gains[START]) / GRIP_S + 1.0
    opened = (gains[START] + gains[LENGTH] + gains[STAY] - t_s) / GRIP_S + 1.0
    grip: float = min(max(min(closed, opened), 0.0), 1.0)
    return grip


@compiled
def _progress(gains: Array, t_s: float) -> tuple[float, float]:
    """Share s of the way at minimum jerk, and its rate [1/s]."""
    x = min(max((t_s - gains[START]) / gains[LENGTH], 0.0), 1.0)
    rest = 1.0 - x
    return x * x * x * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * x * x * (rest * rest) / gains[LENGTH]


@compiled
def guide(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Pull at the adapter.

    F = K (p_hand - p) + D (p_hand' - p') at the end of the adapter, at most force_max_n.

    p_hand = p_0 + s(t) travel + tremor, s(x) = 10 x^3 - 15 x^4 + 6 x^5 (minimum jerk; Flash and Hogan 1985).
    """
    last, before, used = memory[LAST : LAST + 3], memory[BEFORE : BEFORE + 3], NOISE + int(memory[USED])
    shake(gains[A1], gains[A2], memory[used : used + 3], last, before)
    memory[USED] += 3.0
    grip = grip_at(gains, world.step_s)
    if grip == 0.0:
        return GOES_ON
    place, body = site_place(world, world.entry), int(gains[BODY])
    if memory[HOLDS] == 0.0:
        memory[HOLDS] = 1.0
        memory[PLACE : PLACE + 3] = place
    moving, force = scratch(6), scratch(3)  # angular, then linear
    mj_objectVelocity(world.mj_model, world.mj_data, _SITE, world.entry, moving.ctypes.data, 0)
    s, rate = _progress(gains, world.step_s)
    for i in range(3):
        gap = memory[PLACE + i] + s * gains[TRAVEL + i] + last[i] - place[i]
        speed = rate * gains[TRAVEL + i] + (last[i] - before[i]) / world.timestep_s - moving[3 + i]
        force[i] = gains[STIFFNESS] * gap + gains[DAMPING] * speed
    share = grip * min(1.0, gains[MOST] / max(norm(force), 1e-12))
    for i in range(3):
        force[i] *= share
    push_at(world, body, place, force)
    return GOES_ON


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
    """A hand with a tremor of its own generator: `guide`."""

    kernels: Mapping[str, Any] = {"push": guide}

    def __init__(self, config: GuidingHandConfig) -> None:
        self._c = config
        self._rng = np.random.default_rng(0)
        self._strength = 0.0

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Settle the gains, and make room for the tremor's noise of a block."""
        c, period = self._c, float(scene.model.opt.timestep)
        a1, a2, self._strength = resonance(c.tremor, period)
        times = (c.start_s, c.duration_s, c.stay_s)
        grip = (c.stiffness_n_per_m, c.damping_n_s_per_m, c.force_max_n)
        body = int(scene.model.site_bodyid[scene.shaft_entry_site])
        self.gains = np.array([*c.travel_m, *times, *grip, a1, a2, body], dtype=float)
        self.memory = np.zeros(NOISE + 3 * BLOCK_TICKS * round(dt_s / period))

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Draw from the beginning."""
        self._rng = rng

    def refill(self, memory: Array) -> None:
        """Draw what drives the tremor in the physics steps of the coming ticks."""
        memory[NOISE:] = self._strength * self._rng.standard_normal(memory.size - NOISE)
        memory[USED] = 0.0
