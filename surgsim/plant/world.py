"""The plant as the arrays of a tick, and the hooks of its parts as kernels."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import mujoco
import numba
import numpy as np
from numba import types
from numba.extending import is_jitted
from numpy.typing import NDArray

from surgsim.compiled import as_parameter, compiled
from surgsim.errors import SurgsimError
from surgsim.models.build import Scene
from surgsim.plant.bore import Bore
from surgsim.plant.part import PlantPart
from surgsim.plant.state import State
from surgsim.tick.arrays import A1, I1, I2, Kernel, World, hook_signature, type_of
from surgsim.tick.python_part import PythonPart, python_kernel
from surgsim.tick.status import GOES_ON

Array = NDArray[np.float64]
Ids = NDArray[np.int64]

KINDS = ("actuate", "grip", "port_motion", "push", "before_step", "after_step", "sense", "values")
ACTUATE, GRIP, PORT_MOTION, PUSH, BEFORE_STEP, AFTER_STEP, SENSE, VALUES = range(len(KINDS))
"""Kinds of hooks, in the order of a tick."""
SLOTS = 32


@cache
def function_types(n: int) -> Any:
    """Type of the hooks' kernels as one parameter, for n joints."""
    return types.UniTuple(types.FunctionType(hook_signature(n)), SLOTS)  # type: ignore[no-untyped-call]


class Hooks(NamedTuple):
    """Which hooks are called when, on what.

    Attributes:
        order: For each kind the slots to be called, in turn (kinds, SLOTS).
        counts: How many of them (kinds,).
        places: For each slot, where its part's gains, memory and columns begin and end (SLOTS, 6).
        gains: Of all parts.
        memory: Of all parts.
        values: The plant's own columns.
    """

    order: Ids
    counts: Ids
    places: Ids
    gains: Array
    memory: Array
    values: Array


HOOKS = types.NamedTuple([I2, I1, I2, A1, A1, A1], Hooks)  # type: ignore[no-untyped-call]


@cache
def advance_signature(n: int) -> Any:
    """Status = advance(world, bore, hooks, functions): one control period of a plant with n joints."""
    return types.int64(type_of(World, n), type_of(Bore, n), HOOKS, function_types(n))


@compiled
def call_hooks(kind: int, functions: tuple[Kernel, ...], hooks: Hooks, world: World) -> int:
    """Call all hooks of a kind; the first status that does not go on."""
    for i in range(hooks.counts[kind]):
        slot = hooks.order[kind, i]
        at = hooks.places[slot]
        status: int = functions[slot](
            hooks.gains[at[0] : at[1]], world, hooks.memory[at[2] : at[3]], hooks.values[at[4] : at[5]]
        )
        if status != GOES_ON:
            return status
    return GOES_ON


def measured(world: Any) -> State:
    """A copy of what is measured now."""
    return State(
        t_s=float(world.t_s),
        q=world.q_m.copy(),
        v=world.v_m.copy(),
        tau=world.tau_m.copy(),
        p_WC=world.p_WC_m.copy(),
        v_WC=world.v_WC_m.copy(),
        f_T=world.f_T_m.copy(),
    )


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
        parts: What gives the parts' arrays: `gains`, `memory` and the width of its columns.
        joints: Number of the arm's joints.
        world: The plant's record, for kernels that are plain Python.

    Attributes:
        functions: The kernels, one in each slot.
        arrays: What they work on.

    Raises:
        SurgsimError: If there are more hooks than slots.
    """

    def __init__(
        self, hooks: Sequence[Hook], parts: Sequence[tuple[Array, Array, int]], joints: int, world: Any = None
    ) -> None:
        if len(hooks) > SLOTS:
            raise SurgsimError(f"disturbances and props have {len(hooks)} hooks; at most {SLOTS} are allowed")
        ends = np.cumsum([[0, 0, 0]] + [[len(g), len(m), w] for g, m, w in parts], axis=0)
        count = len(hooks)
        self._ends = ends
        order, counts = np.zeros((len(KINDS), SLOTS), dtype=np.int64), np.zeros(len(KINDS), dtype=np.int64)
        places = np.zeros((SLOTS, 6), dtype=np.int64)
        entered = [PythonPart(self._call(slot, h)) for slot, h in enumerate(hooks) if _in_python(h)]
        self._entered, self._world = entered, world
        addresses = np.concatenate([np.zeros(0), *(part.gains for part in entered)])
        self._memories = [m for _, m, _ in parts]
        self._gains = [g for g, _, _ in parts]
        self.arrays = Hooks(
            order=order,
            counts=counts,
            places=places,
            gains=np.zeros(int(ends[-1, 0]) + len(entered)),
            memory=np.zeros(int(ends[-1, 1])),
            values=np.zeros(int(ends[-1, 2])),
        )
        self._first_address = int(ends[-1, 0])
        self._addresses = addresses
        functions: list[Any] = []
        for slot, hook in enumerate(hooks):
            for k in range(3):
                places[slot, 2 * k], places[slot, 2 * k + 1] = ends[hook.part, k], ends[hook.part + 1, k]
            if not _in_python(hook):
                functions.append(hook.kernel)
            else:
                address = self._first_address + sum(f is python_kernel for f in functions)
                places[slot, 0], places[slot, 1] = address, address + 1
                functions.append(python_kernel)
        for kind in range(len(KINDS)):
            slots = sorted((h.rank, h.part, s) for s, h in enumerate(hooks) if h.kind == kind)
            counts[kind] = len(slots)
            order[kind, : len(slots)] = [slot for _, _, slot in slots]
        functions += [python_kernel] * (SLOTS - count)
        self.functions = tuple(as_parameter(function, hook_signature(joints)) for function in functions)

    def _call(self, slot: int, hook: Hook) -> Callable[[], int | None]:
        """What enters a hook in Python; a kernel in plain Python is given its part's slices."""
        if hook.call is not None:
            return hook.call

        def call() -> int:
            a, kernel = self.arrays, hook.kernel
            first = self._ends[hook.part], self._ends[hook.part + 1]
            gains, memory, values = (
                array[first[0][k] : first[1][k]] for k, array in enumerate((a.gains, a.memory, a.values))
            )
            return int(kernel(gains, self._world, memory, values))

        return call

    def fill(self) -> None:
        """Take over the parts' gains and memories, as they are after their start."""
        if self._gains:
            self.arrays.gains[: self._first_address] = np.concatenate([np.zeros(0), *self._gains])
            self.arrays.memory[:] = np.concatenate([np.zeros(0), *self._memories])
        self.arrays.gains[self._first_address :] = self._addresses

    @property
    def state(self) -> dict[str, Array]:
        """The parts' memories and columns; their numbers follow from the scenario, or are addresses."""
        return {"hook_memory": self.arrays.memory, "hook_values": self.arrays.values}

    def values_of(self, part: int) -> Array:
        """The columns of a part, a view of the plant's values."""
        return self.arrays.values[self._ends[part, 2] : self._ends[part + 1, 2]]

    def memory_of(self, part: int) -> Array:
        """The memory of a part, a view of that of all."""
        return self.arrays.memory[self._ends[part, 1] : self._ends[part + 1, 1]]

    def raised(self) -> BaseException | None:
        """What a hook in Python raised."""
        errors = [part.raised() for part in self._entered]
        return next((error for error in errors if error is not None), None)


def _in_python(hook: Hook) -> bool:
    """Whether a hook is entered in Python: a method, or a kernel without its decorator."""
    return hook.call is not None or not (is_jitted(hook.kernel) or vars(numba.config)["DISABLE_JIT"])


def overrides(part: PlantPart, hook: str) -> bool:
    """Whether a part has a hook in Python."""
    return getattr(type(part), hook) is not getattr(PlantPart, hook)


def hook_call(
    part: PlantPart, kind: int, scene: Scene, data: mujoco.MjData, world: Any, values: Callable[[], Array]
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

    def record() -> None:
        values()[:] = part.values()

    calls = {ACTUATE: actuate, GRIP: grip, PORT_MOTION: port_motion, PUSH: push, SENSE: sense, VALUES: record}
    return calls[kind]
