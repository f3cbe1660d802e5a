"""Dynamic plant: MuJoCo's rigid-body dynamics under joint torques."""

from collections.abc import Sequence
from functools import partial
from typing import Any, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.columns import Block, scalar, width
from surgsim.columns import vector as vector_columns
from surgsim.compiled import address_of, as_parameter, compiled
from surgsim.errors import SurgsimError
from surgsim.models.build import Scene
from surgsim.plant.base import Plant
from surgsim.plant.contacts import ContactWatch
from surgsim.plant.ledger import EnergyLedger, after_step, before_step, fill_terms
from surgsim.plant.other_joints import joint_columns
from surgsim.plant.part import BLOCK_TICKS, PlantPart
from surgsim.plant.period import advance_dynamics, begin, look
from surgsim.plant.port import forget, new_bore
from surgsim.plant.records import world_of
from surgsim.plant.state import State
from surgsim.plant.truth import NOWHERE, Truth
from surgsim.plant.world import (
    AFTER_STEP,
    BEFORE_STEP,
    KINDS,
    VALUES,
    Hook,
    HookTable,
    advance_signature,
    hook_call,
    measured,
    overrides,
)
from surgsim.tick.arrays import World
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import vector

_FIRST_PART = 2
"""Own columns and the ledger stand before the parts."""


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
    ) -> Plant:
        """The plant; each part draws from a child of `seed`."""
        return DynamicPlant(scene, control_period_s, parts, seed, energy_ledger=self.energy_ledger)


@compiled
def _own_values(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Forces on wall and tip, and the positions of the joints whose places in `qpos` are the gains."""
    k = 0
    if world.walled:
        for i in range(3):
            out[k + i] = world.f_C[i]
        k += 3
    if world.touched:
        for i in range(3):
            out[k + i] = world.f_T[i]
        k += 3
    qpos = vector(world.qpos, world.nq)
    for i in range(gains.size):
        out[k + i] = qpos[int(gains[i])]
    return GOES_ON


class DynamicPlant:
    """Steps MuJoCo once or more a control tick.

    `mj_step1`, control and other forces, `mj_step2`: the controller sees kinematics and velocities of the
    present state, which a plain `mj_step` would leave one step old. The period itself is the kernel
    `advance_dynamics`; this builds its arrays, starts the parts and calls it. One of several arms is given
    the `data` that all share, and goes through the period with the others (`surgsim.plant.several`).

    Attributes:
        world: The arrays of the plant.
        bore: Those of the physical port.
        advance: Address of the kernel of a control period.
    """

    def __init__(
        self,
        scene: Scene,
        control_period_s: float,
        parts: Sequence[PlantPart] = (),
        seed: np.random.SeedSequence | None = None,
        *,
        energy_ledger: bool = False,
        data: mujoco.MjData | None = None,
    ) -> None:
        self._scene = scene
        self._data = mujoco.MjData(scene.model) if data is None else data
        self._parts = tuple(parts)
        self._seed = seed or np.random.SeedSequence(0)
        self._touched = any(part.touches_tip for part in parts)
        has_wall = scene.wall is not None
        self.world = world_of(
            scene, self._data, control_period_s, disturbed=bool(parts) or has_wall, touched=self._touched
        )
        self.bore = new_bore(scene)
        signature = advance_signature(len(scene.dof_ids))
        self._begin, self._look = as_parameter(begin, signature), as_parameter(look, signature)
        self._advance = as_parameter(advance_dynamics, signature)
        self.advance = address_of(advance_dynamics, signature)
        self._ledger = EnergyLedger(scene, self._data, self.bore) if energy_ledger else None
        for part in self._parts:
            part.attach(scene, control_period_s)
        self._drawn_at = np.full(1, -1.0)
        self._joint_columns, places = joint_columns(scene.parts)
        self._table = self._hooks(places)
        self._contacts = ContactWatch(scene, self._data)

    @property
    def scene(self) -> Scene:
        """The scene of its arm."""
        return self._scene

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data; the plant alone writes them."""
        return self._data

    @property
    def objects(self) -> dict[str, PlantPart]:
        """What of the plant is a Python object with a state, by name."""
        return {f"{type(part).__name__} ({k})": part for k, part in enumerate(self._parts)}

    @property
    def arrays(self) -> dict[str, Array]:
        """The rest of its state, by name: the parts' arrays, and what the jaws change in the model."""
        model = self._scene.model
        return {
            **self._table.state,
            "drawn_at": self._drawn_at,
            "welds": model.eq_data,
            "contact bits": model.geom_conaffinity,
        }

    @property
    def parts(self) -> tuple[PlantPart, ...]:
        """Disturbances and props, in the scenario's order."""
        return self._parts

    @property
    def watch(self) -> ContactWatch:
        """Looks for forbidden contacts."""
        return self._contacts

    @property
    def hooks(self) -> HookTable:
        """The hooks of the parts."""
        return self._table

    @property
    def columns(self) -> tuple[Block, ...]:
        """What the plant adds to the trace."""
        ledger = () if self._ledger is None else EnergyLedger.COLUMNS
        energies = tuple(scalar(f"energy_{term}", "j") for term in ledger)
        wall = (vector_columns("trocar_force", "n"),) if self._scene.wall is not None else ()
        tip = (vector_columns("tip_force", "n"),) if self._touched else ()
        parts = tuple(block for part in self._parts if _records(part) for block in part.columns)
        return (*wall, *tip, *self._joint_columns, *energies, *parts)

    def _hooks(self, places: NDArray[np.intp]) -> HookTable:
        """Own columns, the ledger and all parts, in this order."""
        own = 3 * (self._scene.wall is not None) + 3 * self._touched + len(places)
        ledger, columns = self._ledger, PlantPart()
        columns.gains = places.astype(float)
        shares: list[tuple[Any, int]] = [(columns, own)]
        shares.append((PlantPart(), 0) if ledger is None else (ledger, len(EnergyLedger.COLUMNS)))
        hooks = [Hook(kind=VALUES, part=0, rank=0, kernel=_own_values)]
        if ledger is not None:
            kernels = {BEFORE_STEP: before_step, AFTER_STEP: after_step, VALUES: fill_terms}
            hooks += [Hook(kind=kind, part=1, rank=0, kernel=kernel) for kind, kernel in kernels.items()]
        for number, part in enumerate(self._parts, _FIRST_PART):
            shares.append((part, width(part.columns) if _records(part) else 0))
            hooks += self._hooks_of(part, number)
        return HookTable(hooks, shares, len(self._scene.dof_ids), self.world)

    def _hooks_of(self, part: PlantPart, number: int) -> list[Hook]:
        found = []
        for kind, name in enumerate(KINDS):
            kernel, call = part.kernels.get(name), None
            if kernel is None and kind not in (BEFORE_STEP, AFTER_STEP) and overrides(part, name):
                call = hook_call(
                    part, kind, self._scene, self._data, self.world, partial(self._own_slice, number)
                )
            if kernel is not None or call is not None:
                rank = part.ranks.get(name, part.rank)
                found.append(Hook(kind=kind, part=number, rank=rank, kernel=kernel, call=call))
        return found

    def _own_slice(self, part: int) -> Array:
        """The columns of a part in the plant's values."""
        return self._table.values_of(part)

    def reset(self, q: Array) -> State:
        """Put the arm at rest at joint positions `q` (n,) [rad], held so far by the torques that it needs."""
        mujoco.mj_resetData(self._scene.model, self._data)
        self.pose(q)
        self.forget()
        self._told(self._begin(self.world, self.bore, self._table.record))
        return self.state()

    def pose(self, q: Array) -> None:
        """Put the arm at joint positions `q` (n,) [rad]; nothing looks at it yet."""
        self._data.qpos[self._scene.qpos_ids] = q

    def forget(self) -> None:
        """Forget the last run, and start the parts where the arm now is."""
        world = self.world
        world.tick, world.t_s = 0, 0.0
        world.f_T[:], world.q_cmd[:] = 0.0, np.nan
        self._start_parts()
        self._drawn_at[:] = -1.0
        self.refill()
        forget(self.bore)

    def set_velocity(self, v: Array) -> State:
        """Let the arm move with joint velocities `v` (n,) [rad/s] from here on."""
        self._data.qvel[self._scene.dof_ids] = v
        return self.see()

    def see(self) -> State:
        """Look again, after MuJoCo's data were changed from outside."""
        mujoco.mj_step1(self._scene.model, self._data)
        self._told(self._look(self.world, self.bore, self._table.record))
        return self.state()

    def _start_parts(self) -> None:
        """Parts forget the last run; the same seed draws the same again."""
        seed = np.random.SeedSequence(self._seed.entropy, spawn_key=self._seed.spawn_key)
        for part, child in zip(self._parts, seed.spawn(len(self._parts)), strict=True):
            part.start(self._scene, self._data, np.random.default_rng(child), float(self.world.dt_s))
        self._table.fill()

    def step(self, torque: Array, qdot: Array, jaw: float = 0.0, q_cmd: Array | None = None) -> State:
        """Let `torque` (n,) [N m], saturated at the limits, act for one control period.

        Args:
            torque: Commanded torque.
            qdot: Not used: the resolver's velocities are for a kinematic plant.
            jaw: How far the instrument's jaws are told to close, from 0 (open) to 1.
            q_cmd: Joint positions at the end of the period for the arm's own impedance loop (n,) [rad], which
                adds the torque to its own; None: the torque alone is commanded.
        """
        self.world.torque[:], self.world.qdot[:], self.world.jaw = torque, qdot, jaw
        self.world.q_cmd[:] = np.nan if q_cmd is None else q_cmd
        self.refill()
        self._told(self._advance(self.world, self.bore, self._table.record))
        return self.state()

    def refill(self) -> None:
        """Let the parts draw what they need for the coming ticks; to be called every `BLOCK_TICKS`."""
        tick = int(self.world.tick)
        if tick % BLOCK_TICKS == 0 and tick != self._drawn_at[0]:
            self._drawn_at[0] = tick
            for number, part in enumerate(self._parts, _FIRST_PART):
                part.refill(self._table.memory_of(number))

    def state(self) -> State:
        """A copy of what is measured now."""
        return measured(self.world)

    def truth(self) -> Truth:
        """Where things really are now."""
        world = self.world
        return Truth(
            q=world.q.copy(),
            v=world.v.copy(),
            p_WT=world.p_WT.copy(),
            p_WS=world.p_WS.copy(),
            p_WR=world.p_WR.copy(),
            p_WC=world.p_WC.copy(),
            f_C=world.f_C.copy() if self._scene.wall is not None else NOWHERE,
            f_T=world.f_T.copy() if self._touched else NOWHERE,
            contact=self._contacts.look(world.p_WC),
            values=self._table.values.copy(),
        )

    def _told(self, status: int) -> None:
        """Raise what a part in Python raised, or say that a kernel gave a status."""
        if status != GOES_ON:
            raise self._table.raised() or SurgsimError(f"a disturbance or prop told status {status}")


def _records(part: PlantPart) -> bool:
    return "values" in part.kernels or overrides(part, "values")
