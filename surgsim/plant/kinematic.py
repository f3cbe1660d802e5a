"""Kinematic plant: perfect velocity tracking, the setting of the manipulability paper."""

from collections.abc import Sequence
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.catalog import PartConfig
from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import Disturbance
from surgsim.plant.state import State
from surgsim.plant.truth import Truth, TruthReader

Array = NDArray[np.float64]


class KinematicPlantConfig(PartConfig):
    """Integrates the resolver's joint velocities exactly; no dynamics."""

    type: Literal["kinematic"] = "kinematic"

    @property
    def uses_torque(self) -> bool:
        """Whether the plant is driven by torques."""
        return False

    def build(
        self,
        scene: Scene,
        control_period_s: float,
        disturbances: Sequence[Disturbance],
        seed: np.random.SeedSequence,
    ) -> "KinematicPlant":
        """The plant; disturbances do not act on it."""
        return KinematicPlant(scene, control_period_s)


class KinematicPlant:
    """q(k+1) = q(k) + T q'(k), eq. (5) of the manipulability paper."""

    def __init__(self, scene: Scene, control_period_s: float) -> None:
        self._scene = scene
        self._data = mujoco.MjData(scene.model)
        self._dt = control_period_s
        self._tick = 0
        self._reader = TruthReader(scene, self._data)

    def reset(self, q: Array) -> State:
        """Put the arm at rest at joint positions `q` (7,) [rad]."""
        mujoco.mj_resetData(self._scene.model, self._data)
        self._tick = 0
        return self._place(q, np.zeros(7))

    def step(self, torque: Array, qdot: Array) -> State:
        """Move with velocity `qdot` (7,) [rad/s] for one control period."""
        q = self._data.qpos[self._scene.qpos_ids] + self._dt * qdot
        self._tick += 1
        return self._place(q, qdot)

    def truth(self) -> Truth:
        """Where tip, wrist and trocar are now."""
        return self._reader.read()

    def _place(self, q: Array, v: Array) -> State:
        self._data.qpos[self._scene.qpos_ids] = q
        mujoco.mj_kinematics(self._scene.model, self._data)
        now = self.truth()
        return State(
            t_s=self._tick * self._dt,
            q=q.copy(),
            v=v.copy(),
            tau=np.zeros(7),
            p_WC=now.p_WC,
            v_WC=np.zeros(3),
        )
