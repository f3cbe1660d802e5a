"""Measurements that are old when the controller sees them."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from surgsim.array import Array
from surgsim.catalog import Surroundings
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import LATE, Disturbance, DisturbanceConfig, whole_ticks
from surgsim.tick.arrays import World
from surgsim.tick.status import GOES_ON

_OTHERS = 29
"""Numbers of a row beside those of the joints: port, forces on tip and flange, the tracker's last sample."""


@compiled
def _write(world: World, row: Array) -> None:
    """What is measured now, to a row (3 n + 29,)."""
    n = world.q_m.size
    for i in range(n):
        row[i], row[n + i], row[2 * n + i] = world.q_m[i], world.v_m[i], world.tau_m[i]
    for i in range(3):
        row[3 * n + i], row[3 * n + 3 + i], row[3 * n + 6 + i] = (
            world.p_WC_m[i],
            world.v_WC_m[i],
            world.f_T_m[i],
        )
        row[3 * n + 9 + i] = world.p_WT_m[i]
        row[3 * n + 23 + i], row[3 * n + 26 + i] = world.f_S_m[i], world.m_S_m[i]
        for k in range(3):
            row[3 * n + 12 + 3 * i + k] = world.R_WT_m[i, k]
    row[3 * n + 21], row[3 * n + 22] = world.tracked_samples, world.tracked_age_s


@compiled
def _read(world: World, row: Array) -> None:
    """What was measured, from a row (3 n + 29,)."""
    n = world.q_m.size
    for i in range(n):
        world.q_m[i], world.v_m[i], world.tau_m[i] = row[i], row[n + i], row[2 * n + i]
    for i in range(3):
        world.p_WC_m[i] = row[3 * n + i]
        world.v_WC_m[i] = row[3 * n + 3 + i]
        world.f_T_m[i] = row[3 * n + 6 + i]
        world.p_WT_m[i] = row[3 * n + 9 + i]
        world.f_S_m[i], world.m_S_m[i] = row[3 * n + 23 + i], row[3 * n + 26 + i]
        for k in range(3):
            world.R_WT_m[i, k] = row[3 * n + 12 + 3 * i + k]
    world.tracked_samples, world.tracked_age_s = int(row[3 * n + 21]), row[3 * n + 22]


@compiled
def delay(gains: Array, world: World, memory: Array, out: Array) -> int:
    """What was measured d ticks ago, at the present time; the memory is the last d + 1 states in a ring.

    All of them are the first one at the start: the arm was at rest before.
    """
    width = 3 * world.q_m.size + _OTHERS
    count = memory.size // width
    if world.tick == 0:
        for k in range(count):
            _write(world, memory[k * width : (k + 1) * width])
        return GOES_ON
    now, then = world.tick % count, (world.tick + 1) % count
    _write(world, memory[now * width : (now + 1) * width])
    _read(world, memory[then * width : (then + 1) * width])
    return GOES_ON


class SensorDelayConfig(DisturbanceConfig):
    """The whole measured state is old: joints, torques, port, forces, instrument; the time is the present.

    Attributes:
        delay_s: Its age, a whole multiple of the control period [s].
    """

    type: Literal["sensor_delay"] = "sensor_delay"
    delay_s: Annotated[float, Field(gt=0.0, le=0.5)] = 0.002

    def check(self, scenario: Surroundings) -> None:
        """Refuse a delay that is no whole multiple of the control period."""
        whole_ticks("sensor_delay", "delay_s", self.delay_s, scenario.control_period_s)

    def build(self, rng: np.random.Generator) -> "SensorDelay":
        """The disturbance."""
        return SensorDelay(self)


class SensorDelay(Disturbance):
    """A ring of states, full of the first one at the start."""

    rank = LATE
    kernels: Mapping[str, Any] = {"sense": delay}

    def __init__(self, config: SensorDelayConfig) -> None:
        self._c = config

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Make room for the states."""
        ticks = round(self._c.delay_s / dt_s)
        self.memory = np.zeros((ticks + 1) * (3 * len(scene.dof_ids) + _OTHERS))
