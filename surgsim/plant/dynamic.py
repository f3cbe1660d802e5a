"""Dynamic plant: MuJoCo's rigid-body dynamics under joint torques."""

from collections.abc import Sequence
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.catalog import PartConfig
from surgsim.columns import Block, scalar, vector
from surgsim.models.build import Scene
from surgsim.plant.bystanders import Bystanders
from surgsim.plant.contacts import ContactWatch
from surgsim.plant.ledger import EnergyLedger
from surgsim.plant.part import PlantPart
from surgsim.plant.parts import PlantParts
from surgsim.plant.port import Port
from surgsim.plant.state import NO_FORCE, State
from surgsim.plant.truth import NO_VALUES, NOWHERE, PointReader, Truth, arm_view

Array = NDArray[np.float64]
_AT_REST = np.zeros(3)
_AT_REST.flags.writeable = False


class DynamicPlantConfig(PartConfig):
    """Rigid-body dynamics driven by joint torques, saturated at the arm's limits.

    Attributes:
        energy_ledger: Whether the energy of arm and wall is accounted for at every step and recorded.
    """

    type: Literal["dynamic"] = "dynamic"
    energy_ledger: bool = False

    @property
    def uses_torque(self) -> bool:
        """Whether the plant is driven by torques."""
        return True

    def build(
        self, scene: Scene, control_period_s: float, parts: Sequence[PlantPart], seed: np.random.SeedSequence
    ) -> "DynamicPlant":
        """The plant; each part draws from a child of `seed`."""
        return DynamicPlant(scene, control_period_s, parts, seed, energy_ledger=self.energy_ledger)


class DynamicPlant:
    """Steps MuJoCo once or more a control tick.

    `mj_step1`, control and other forces, `mj_step2`: the controller sees kinematics and velocities of the
    present state, which a plain `mj_step` would leave one step old.
    """

    def __init__(
        self,
        scene: Scene,
        control_period_s: float,
        parts: Sequence[PlantPart] = (),
        seed: np.random.SeedSequence | None = None,
        *,
        energy_ledger: bool = False,
    ) -> None:
        self._scene = scene
        self._model = scene.model
        self._data = mujoco.MjData(scene.model)
        self._parts = PlantParts(parts, seed or np.random.SeedSequence(0))
        self._qpos = arm_view(self._data.qpos, scene.qpos_ids)
        self._qvel = arm_view(self._data.qvel, scene.dof_ids)
        self._ctrl = arm_view(self._data.ctrl, scene.actuator_ids)
        self._dt = control_period_s
        self._timestep = scene.model.opt.timestep
        self._substeps = round(control_period_s / self._timestep)
        self._port = Port(scene, self._data)
        self._ledger = EnergyLedger(scene, self._data, self._port) if energy_ledger else None
        self._bystanders = Bystanders(scene, self._data)
        self._has_wall = scene.wall is not None
        self._disturbed = bool(parts) or self._has_wall
        self._points = PointReader(scene, self._data)
        self._contacts = ContactWatch(scene, self._data)
        self._tick = 0
        self._tau = np.zeros(7)
        self._f_T = NO_FORCE
        self._adds_columns = bool(self.columns)
        self._truth = self._look()

    @property
    def columns(self) -> tuple[Block, ...]:
        """What the plant adds to the trace."""
        ledger = () if self._ledger is None else EnergyLedger.COLUMNS
        energies = tuple(scalar(f"energy_{term}", "j") for term in ledger)
        wall = (vector("trocar_force", "n"),) if self._has_wall else ()
        tip = (vector("tip_force", "n"),) if self._parts.touch_tip else ()
        return (*wall, *tip, *self._bystanders.columns, *energies, *self._parts.columns)

    def reset(self, q: Array) -> State:
        """Put the arm at rest at joint positions `q` (7,) [rad], held so far by the torques that it needs."""
        mujoco.mj_resetData(self._model, self._data)
        self._qpos[:] = q
        self._tick = 0
        self._tau = np.zeros(7)
        self._f_T = NO_FORCE
        self._parts.start(self._scene, self._data, self._dt)
        self._port.reset()
        self._clear_forces(0.0)
        mujoco.mj_step1(self._model, self._data)
        self._tau = arm_view(self._data.qfrc_bias, self._scene.dof_ids).copy()
        if self._ledger is not None:
            self._ledger.start()
        return self._state()

    def step(self, torque: Array, qdot: Array, jaw: float = 0.0) -> State:
        """Let `torque` (7,) [N m], saturated at the limits, act for one control period.

        Args:
            torque: Commanded torque.
            qdot: Not used: the resolver's velocities are for a kinematic plant.
            jaw: How far the instrument's jaws are told to close, from 0 (open) to 1.
        """
        limit = self._scene.limits.torque
        torque = np.minimum(np.maximum(torque, -limit), limit)
        if self._disturbed:
            torque = self._parts.actuate(torque)
            self._parts.grip(jaw)
        self._tau = torque
        self._ctrl[:] = torque
        start = self._tick * self._dt
        for i in range(self._substeps):
            if i > 0:
                self._clear_forces(start + i * self._timestep)
                mujoco.mj_step1(self._model, self._data)
            self._advance(start + i * self._timestep)
        if self._parts.touch_tip:
            self._f_T = self._bystanders.force_on_tip()
        self._tick += 1
        self._clear_forces(self._tick * self._dt)
        mujoco.mj_step1(self._model, self._data)
        return self._state()

    def truth(self) -> Truth:
        """Where things really are now."""
        return self._truth

    def _clear_forces(self, t_s: float) -> None:
        """Forces of the last step are forgotten, the port is moved to where it is at `t_s`."""
        if self._disturbed:
            self._data.xfrc_applied[:] = 0.0
            self._data.qfrc_applied[:] = 0.0
            motion = self._parts.port_motion(t_s)
            self._port.move(motion.offset, motion.velocity)

    def _advance(self, t_s: float) -> None:
        """From `mj_step1` at `t_s` to the end of the step."""
        if self._disturbed:
            self._parts.push(t_s, self._scene, self._data)
            self._port.act()
        if self._ledger is not None:
            self._ledger.before_step()
        mujoco.mj_step2(self._model, self._data)
        if self._ledger is not None:
            self._ledger.after_step()

    def _look(self) -> Truth:
        p_WT, p_WR, p_WC = self._points.read()
        f_C = self._port.force() if self._has_wall else NOWHERE
        touched = self._parts.touch_tip
        return Truth(
            q=self._qpos.copy(),
            v=self._qvel.copy(),
            p_WT=p_WT,
            p_WR=p_WR,
            p_WC=p_WC,
            f_C=f_C,
            f_T=self._f_T if touched else NOWHERE,
            contact=self._contacts.look(p_WC),
            values=self._values(f_C) if self._adds_columns else NO_VALUES,
        )

    def _values(self, f_C: Array) -> Array:
        """Values of `columns` now."""
        return np.concatenate(
            (
                f_C if self._has_wall else NO_VALUES,
                self._f_T if self._parts.touch_tip else NO_VALUES,
                self._bystanders.values(),
                NO_VALUES if self._ledger is None else self._ledger.terms(),
                self._parts.values(),
            )
        )

    def _state(self) -> State:
        truth = self._truth = self._look()
        state = State(
            t_s=self._tick * self._dt,
            q=truth.q,
            v=truth.v,
            tau=self._tau,
            p_WC=truth.p_WC,
            v_WC=_AT_REST,
            f_T=self._f_T,
        )
        return self._parts.sense(state) if self._disturbed else state
