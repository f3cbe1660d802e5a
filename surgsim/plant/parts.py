"""All parts of a plant as one: each hook called on those parts that have it."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.columns import Block
from surgsim.models.build import Scene
from surgsim.plant.part import PlantPart, PortMotion
from surgsim.plant.state import State

Array = NDArray[np.float64]


class PlantParts:
    """The parts in the scenario's order, each with its own child of the run's seed.

    Args:
        parts: The parts.
        seed: Where the randomness during a run comes from.
    """

    def __init__(self, parts: Sequence[PlantPart], seed: np.random.SeedSequence) -> None:
        self._parts = tuple(parts)
        self._seed = seed
        self._actuating = self._having("actuate")
        self._gripping = self._having("grip")
        self._pushing = self._having("push")
        self._moving = self._having("port_motion")
        self._sensing = self._having("sense")
        self.touch_tip = any(part.touches_tip for part in parts)
        self._recording = self._having("values")

    def _having(self, hook: str) -> tuple[PlantPart, ...]:
        """The parts that override `hook`, by rank."""
        having = [part for part in self._parts if getattr(type(part), hook) is not getattr(PlantPart, hook)]
        return tuple(sorted(having, key=lambda part: part.rank))

    @property
    def columns(self) -> tuple[Block, ...]:
        """Columns of all parts, in order."""
        return tuple(block for part in self._recording for block in part.columns)

    def start(self, scene: Scene, data: mujoco.MjData, dt_s: float) -> None:
        """Forget the last run; the same seed draws the same again."""
        seed = np.random.SeedSequence(self._seed.entropy, spawn_key=self._seed.spawn_key)
        for part, child in zip(self._parts, seed.spawn(len(self._parts)), strict=True):
            part.start(scene, data, np.random.default_rng(child), dt_s)

    def actuate(self, torque: Array) -> Array:
        """Torque that reaches the joints (7,) [N m]."""
        for part in self._actuating:
            torque = part.actuate(torque)
        return torque

    def grip(self, jaw: float) -> None:
        """The jaws are told to be closed by `jaw`."""
        for part in self._gripping:
            part.grip(jaw)

    def push(self, t_s: float, scene: Scene, data: mujoco.MjData) -> None:
        """Add all forces."""
        for part in self._pushing:
            part.push(t_s, scene, data)

    def port_motion(self, t_s: float) -> PortMotion:
        """Sum of all motions of the incision at `t_s` [s]."""
        offset, velocity = np.zeros(3), np.zeros(3)
        for part in self._moving:
            motion = part.port_motion(t_s)
            if motion is not None:
                offset, velocity = offset + motion.offset, velocity + motion.velocity
        return PortMotion(offset=offset, velocity=velocity)

    def sense(self, state: State) -> State:
        """What is measured of `state`."""
        for part in self._sensing:
            state = part.sense(state)
        return state

    def values(self) -> Array:
        """Values of `columns` now."""
        if not self._recording:
            return np.zeros(0)
        return np.concatenate([part.values() for part in self._recording])
