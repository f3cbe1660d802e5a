"""The plant as the arrays of a tick, and the hooks of its parts as kernels."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import mujoco
import numba
import numpy as np
from numba import types
from numba.extending import is_jitted

from surgsim.array import Array
from surgsim.compiled import address_of, call_at, compiled
from surgsim.errors import SurgsimError
from surgsim.models.build import Scene
from surgsim.plant.bore import Bore
from surgsim.plant.part import PlantPart
from surgsim.plant.state import NOT_TRACKED, State, TrackedPose, Wrench
from surgsim.tick.arrays import Numbers, Record, World, hook_signature, new, point, type_of
from surgsim.tick.python_part import PythonPart, first_raised, python_kernel
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import vector, words

KINDS = ("actuate", "grip", "port_motion", "push", "before_step", "after_step", "sense", "values")
ACTUATE, GRIP, PORT_MOTION, PUSH, BEFORE_STEP, AFTER_STEP, SENSE, VALUES = range(len(KINDS))
"""Kinds of hooks, in the order of a tick."""
SLOTS = 32
_ENTRY = 7


class Hooks(Record):
    """Which hooks are called when, on what.

    Attributes:
        table: Address of the hooks of each kind in turn: address of the kernel, addresses and sizes of its
            part's gains, memory and columns, seven words for each (kinds, SLOTS).
        counts: Address of how many there are of each kind (kinds,).
        values: The plant's own columns.
    """

    ADDRESSES: ClassVar[frozenset[str]] = frozenset(("table", "counts"))
    table: int
    counts: int
    values: Numbers


@cache
def advance_signature(n: int) -> Any:
    """Status = advance(world, bore, hooks): one control period of a plant with n joints."""
    return types.int64(type_of(World, n), type_of(Bore, n), type_of(Hooks, 0))


@compiled
def call_hooks(kind: int, hooks: Hooks, world: World) -> int:
    """Call all hooks of a kind; the first status that does not go on."""
    for i in range(words(hooks.counts + 8 * kind, 1)[0]):
        at = words(hooks.table + 8 * _ENTRY * (SLOTS * kind + i), _ENTRY)
        gains, memory, out = vector(at[1], at[2]), vector(at[3], at[4]), vector(at[5], at[6])
        status: int = call_at(at[0], gains, world, memory, out)
        if status != GOES_ON:
            return status
    return GOES_ON


def measured(world: World) -> State:
    """A copy of what is measured now."""
    return State(
        t_s=float(world.t_s),
        q=world.q_m.copy(),
        v=world.v_m.copy(),
        tau=world.tau_m.copy(),
        p_WC=world.p_WC_m.copy(),
        v_WC=world.v_WC_m.copy(),
        f_T=world.f_T_m.copy(),
        tracked=_tracked(world),
        wrench=Wrench(force=world.f_S_m.copy(), moment=world.m_S_m.copy()) if world.has_wrench else None,
    )


def _tracked(world: World) -> TrackedPose:
    """A copy of the tracker's last sample."""
    samples = int(world.tracked_samples)
    if samples == 0:
        return NOT_TRACKED
    age_s = float(world.tracked_age_s)
    return TrackedPose(samples=samples, age_s=age_s, p_WT=world.p_WT_m.copy(), R_WT=world.R_WT_m.copy())


@dataclass(frozen=True, kw_only=True)
class Hook:
    """One hook of one part.

    Attributes:
        kind: Index in `KINDS`.
        part: Whose it is, an index.
        rank: Where it stands among those of its kind: lower first, then by part.
        kernel: A kernel, compiled or plain Python; None: `call` is called.
        call: What is to be called in Python.
    """

    kind: int
    part: int
    rank: int
    kernel: Any = None
    call: Callable[[], None] | None = None


class HookTable:
    """The hooks of a plant's parts, joined to arrays.

    Args:
        hooks: The hooks.
        parts: Whose `gains` and `memory` they work on, and how many columns each has.
        joints: Number of the arm's joints.
        world: The plant's record, for kernels that are plain Python.

    Attributes:
        record: What `call_hooks` works on.
        values: The plant's own columns.

    Raises:
        SurgsimError: If there are more hooks than slots.
    """

    def __init__(
        self, hooks: Sequence[Hook], parts: Sequence[tuple[PlantPart, int]], joints: int, world: World
    ) -> None:
        if len(hooks) > SLOTS:
            raise SurgsimError(f"plant, disturbances and props have {len(hooks)} hooks; at most {SLOTS} fit")
        self._parts, self._world = [part for part, _ in parts], world
        ends = np.cumsum([[0, 0, 0]] + [[len(p.gains), len(p.memory), w] for p, w in parts], axis=0)
        self._ends, self._entered = ends, list[PythonPart]()
        self._gains, self._memory, self.values = (np.zeros(int(size)) for size in ends[-1])
        self._table = np.zeros((len(KINDS), SLOTS, _ENTRY), dtype=np.int64)
        self._counts = np.zeros(len(KINDS), dtype=np.int64)
        for hook in sorted(hooks, key=lambda hook: (hook.kind, hook.rank, hook.part)):
            self._table[hook.kind, self._counts[hook.kind]] = self._entry(hook, joints)
            self._counts[hook.kind] += 1
        self.record = new(Hooks, 0)
        self.record.table, self.record.counts = self._table.ctypes.data, self._counts.ctypes.data
        point(self.record.values, self.values)

    def _entry(self, hook: Hook, joints: int) -> list[int]:
        """A row of the table."""
        arrays, kernel = list(self._shares(hook.part)), hook.kernel
        if _in_python(hook):
            entered, kernel = PythonPart(self._call(hook)), python_kernel
            self._entered.append(entered)
            arrays[0] = entered.gains
        entry = [address_of(kernel, hook_signature(joints))]
        for array in arrays:
            entry += [array.ctypes.data, array.size]
        return entry

    def _shares(self, part: int) -> tuple[Array, Array, Array]:
        """Gains, memory and columns of a part, views of those of all."""
        first, end = self._ends[part], self._ends[part + 1]
        return (
            self._gains[first[0] : end[0]],
            self._memory[first[1] : end[1]],
            self.values[first[2] : end[2]],
        )

    def _call(self, hook: Hook) -> Callable[[], int | None]:
        """What enters a hook in Python; a kernel in plain Python is given its part's arrays."""
        if hook.call is not None:
            return hook.call
        gains, memory, values = self._shares(hook.part)
        return lambda: int(hook.kernel(gains, self._world, memory, values))

    def fill(self) -> None:
        """Take over the parts' gains and memories, as they are after their start.

        Raises:
            SurgsimError: If a part has changed their size since it was attached.
        """
        for k, part in enumerate(self._parts):
            for name, share in zip(("gains", "memory"), self._shares(k), strict=False):
                given = getattr(part, name)
                if given.shape != share.shape:
                    raise SurgsimError(
                        f"{type(part).__name__}: {name} had {share.size} numbers when it was attached, "
                        f"and has the shape {given.shape} after its start"
                    )
                share[:] = given

    @property
    def state(self) -> dict[str, Array]:
        """The parts' memories and columns; their numbers follow from the scenario, or are addresses."""
        return {"hook_memory": self._memory, "hook_values": self.values}

    def values_of(self, part: int) -> Array:
        """The columns of a part, a view of the plant's values."""
        return self._shares(part)[2]

    def memory_of(self, part: int) -> Array:
        """The memory of a part, a view of that of all."""
        return self._shares(part)[1]

    def raised(self) -> BaseException | None:
        """What a hook in Python raised."""
        return first_raised(self._entered)


def _in_python(hook: Hook) -> bool:
    """Whether a hook is entered in Python: a method, or a kernel without its decorator."""
    return hook.call is not None or not (is_jitted(hook.kernel) or vars(numba.config)["DISABLE_JIT"])


def overrides(part: PlantPart, hook: str) -> bool:
    """Whether a part has a hook in Python."""
    return getattr(type(part), hook) is not getattr(PlantPart, hook)


def hook_call(
    part: PlantPart, kind: int, scene: Scene, data: mujoco.MjData, world: World, values: Callable[[], Array]
) -> Callable[[], None]:
    """What enters a part's hook of a kind in Python, its answer written to the world's arrays."""

    def actuate() -> None:
        world.torque[:] = part.actuate(world.torque.copy())

    def grip() -> None:
        part.grip(float(world.jaw))

    def port_motion() -> None:
        motion = part.port_motion(float(world.step_s))
        if motion is not None:
            world.port_offset[:] += motion.offset
            world.port_velocity[:] += motion.velocity

    def push() -> None:
        part.push(float(world.step_s), scene, data)

    def sense() -> None:
        state = part.sense(measured(world))
        world.q_m[:], world.v_m[:], world.tau_m[:] = state.q, state.v, state.tau
        world.p_WC_m[:], world.v_WC_m[:], world.f_T_m[:] = state.p_WC, state.v_WC, state.f_T
        pose = state.tracked
        world.tracked_samples, world.tracked_age_s = pose.samples, pose.age_s
        world.p_WT_m[:], world.R_WT_m[:] = pose.p_WT, pose.R_WT
        world.has_wrench = state.wrench is not None
        if state.wrench is not None:
            world.f_S_m[:], world.m_S_m[:] = state.wrench.force, state.wrench.moment

    def record() -> None:
        values()[:] = part.values()

    calls = {ACTUATE: actuate, GRIP: grip, PORT_MOTION: port_motion, PUSH: push, SENSE: sense, VALUES: record}
    return calls[kind]
