"""Dynamic plant: MuJoCo's rigid-body dynamics under joint torques."""

from collections.abc import Sequence
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.catalog import PartConfig
from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import Disturbance
from surgsim.plant.state import State
from surgsim.plant.truth import Truth, TruthReader, arm_view

Array = NDArray[np.float64]
_AT_REST = np.zeros(3)
_AT_REST.flags.writeable = False


class DynamicPlantConfig(PartConfig):
    """Rigid-body dynamics driven by joint torques, saturated at the arm's limits."""

    type: Literal["dynamic"] = "dynamic"

    @property
    def uses_torque(self) -> bool:
        """Whether the plant is driven by torques."""
        return True

    def build(
        self,
        scene: Scene,
        control_period_s: float,
        disturbances: Sequence[Disturbance],
        seed: np.random.SeedSequence,
    ) -> "DynamicPlant":
        """The plant; each disturbance draws from a child of `seed`."""
        return DynamicPlant(scene, control_period_s, disturbances, seed)


class DynamicPlant:
    """Steps MuJoCo once or more a control tick.

    `mj_step1`, control, `mj_step2`: the controller sees kinematics and velocities of the present state,
    which a plain `mj_step` would leave one step old.
    """

    def __init__(
        self,
        scene: Scene,
        control_period_s: float,
        disturbances: Sequence[Disturbance] = (),
        seed: np.random.SeedSequence | None = None,
    ) -> None:
        self._scene = scene
        self._disturbances = tuple(disturbances)
        self._seed = seed or np.random.SeedSequence(0)
        self._data = mujoco.MjData(scene.model)
        self._qpos = arm_view(self._data.qpos, scene.qpos_ids)
        self._qvel = arm_view(self._data.qvel, scene.dof_ids)
        self._ctrl = arm_view(self._data.ctrl, scene.actuator_ids)
        self._dt = control_period_s
        self._substeps = round(control_period_s / scene.model.opt.timestep)
        self._tick = 0
        self._tau = np.zeros(7)
        self._reader = TruthReader(scene, self._data)
        self._truth = self._reader.read()

    def reset(self, q: Array) -> State:
        """Put the arm at rest at joint positions `q` (7,) [rad]."""
        mujoco.mj_resetData(self._scene.model, self._data)
        self._qpos[:] = q
        self._tick = 0
        self._tau = np.zeros(7)
        children = np.random.SeedSequence(self._seed.entropy, spawn_key=self._seed.spawn_key).spawn(
            len(self._disturbances)
        )
        for disturbance, child in zip(self._disturbances, children, strict=True):
            disturbance.start(self._scene, np.random.default_rng(child), self._dt)
        mujoco.mj_step1(self._scene.model, self._data)
        return self._state()

    def step(self, torque: Array, qdot: Array) -> State:
        """Let `torque` (7,) [N m], saturated at the limits, act for one control period."""
        model, data, limit = self._scene.model, self._data, self._scene.limits.torque
        torque = np.minimum(np.maximum(torque, -limit), limit)
        if self._disturbances:
            data.xfrc_applied[:] = 0.0
            for disturbance in self._disturbances:
                torque = disturbance.delay(torque)
                disturbance.push(self._tick * self._dt, self._scene, data)
        self._tau = torque
        self._ctrl[:] = torque
        mujoco.mj_step2(model, data)
        for _ in range(self._substeps - 1):
            mujoco.mj_step(model, data)
        mujoco.mj_step1(model, data)
        self._tick += 1
        return self._state()

    def truth(self) -> Truth:
        """Where tip, wrist and trocar are now."""
        return self._truth

    def _state(self) -> State:
        self._truth = self._reader.read()
        return State(
            t_s=self._tick * self._dt,
            q=self._qpos.copy(),
            v=self._qvel.copy(),
            tau=self._tau,
            p_WC=self._truth.p_WC,
            v_WC=_AT_REST,
        )
