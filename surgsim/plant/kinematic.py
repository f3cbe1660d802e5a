"""Kinematic plant: perfect velocity tracking, the setting of the manipulability paper."""

from collections.abc import Sequence
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.catalog import PartConfig
from surgsim.columns import Block
from surgsim.models.build import Scene
from surgsim.plant.contacts import ContactWatch
from surgsim.plant.part import PlantPart
from surgsim.plant.state import State
from surgsim.plant.truth import PointReader, Truth

Array = NDArray[np.float64]


class KinematicPlantConfig(PartConfig):
    """Integrates the resolver's joint velocities exactly; no dynamics."""

    type: Literal["kinematic"] = "kinematic"

    @property
    def uses_torque(self) -> bool:
        """Whether the plant is driven by torques."""
        return False

    def build(
        self, scene: Scene, control_period_s: float, parts: Sequence[PlantPart], seed: np.random.SeedSequence
    ) -> "KinematicPlant":
        """The plant; disturbances and props do not act on it."""
        return KinematicPlant(scene, control_period_s)


class KinematicPlant:
    """q(k+1) = q(k) + T q'(k), eq. (5) of the manipulability paper."""

    columns: tuple[Block, ...] = ()

    def __init__(self, scene: Scene, control_period_s: float) -> None:
        self._scene = scene
        self._data = mujoco.MjData(scene.model)
        self._dt = control_period_s
        self._tick = 0
        self._v = np.zeros(7)
        self._points = PointReader(scene, self._data)
        self._contacts = ContactWatch(scene, self._data)

    def reset(self, q: Array) -> State:
        """Put the arm at rest at joint positions `q` (7,) [rad]."""
        mujoco.mj_resetData(self._scene.model, self._data)
        self._tick = 0
        return self._place(q, np.zeros(7))

    def step(self, torque: Array, qdot: Array, jaw: float = 0.0) -> State:
        """Move with velocity `qdot` (7,) [rad/s] for one control period; torque and jaws do nothing."""
        q = self._data.qpos[self._scene.qpos_ids] + self._dt * qdot
        self._tick += 1
        return self._place(q, qdot)

    def truth(self) -> Truth:
        """Where things are now."""
        p_WT, p_WR, p_WC = self._points.read()
        q = np.array(self._data.qpos[self._scene.qpos_ids])
        contact = self._contacts.look(p_WC)
        return Truth(q=q, v=self._v, p_WT=p_WT, p_WR=p_WR, p_WC=p_WC, contact=contact)

    def _place(self, q: Array, v: Array) -> State:
        self._data.qpos[self._scene.qpos_ids] = q
        self._v = v.copy()
        mujoco.mj_kinematics(self._scene.model, self._data)
        now = self.truth()
        return State(
            t_s=self._tick * self._dt, q=now.q, v=now.v, tau=np.zeros(7), p_WC=now.p_WC, v_WC=np.zeros(3)
        )
