"""Several arms in one model: each with its plant, and time that passes for all of them at once."""

from collections.abc import Sequence
from functools import cache
from typing import Any, ClassVar

import mujoco
import numpy as np
from numba import types

from surgsim.array import Array
from surgsim.compiled import address_of, as_parameter, call_at, compiled
from surgsim.errors import SurgsimError
from surgsim.plant.dynamic import DynamicPlant
from surgsim.plant.kinematic import KinematicPlant, of_several_kinematic
from surgsim.plant.period import (
    CLEARED,
    COMMANDED,
    ENDED,
    HELD,
    MOVED,
    PUSHED,
    SEEN,
    STEPPED,
    of_several,
    stage_signature,
)
from surgsim.tick.arrays import Record, new, type_of
from surgsim.tick.mujoco_calls import mj_kinematics, mj_step1, mj_step2
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import place_of, record_at, words

SharedPlant = DynamicPlant | KinematicPlant
"""A plant that can share its model with others."""
_ENTRY = 4


class Shared(Record):
    """The physics that several arms share.

    Attributes:
        mj_model: Address of MuJoCo's model.
        mj_data: Address of MuJoCo's data.
        table: Address of the arms: for each the address of the kernel of its stages, and those of its records
            (count, 4).
        count: Arms.
        substeps: Physics steps in a control period.
        kinematic: Whether arms follow velocities, and no physics are stepped.
        who: The arm whose part was the last to tell a status that does not go on.
    """

    ADDRESSES: ClassVar[frozenset[str]] = frozenset(("mj_model", "mj_data", "table"))
    mj_model: int
    mj_data: int
    table: int
    count: int
    substeps: int
    kinematic: int
    who: int


@cache
def shared_signature() -> Any:
    """Status = begin_several(shared)."""
    return types.int64(type_of(Shared, 0))


@compiled
def _all(shared: Shared, stage: int, k: int) -> int:
    """Let every arm go through a stage; the first status that does not go on."""
    for i in range(shared.count):
        at = words(shared.table + 8 * _ENTRY * i, _ENTRY)
        status: int = call_at(at[0], stage, k, record_at(at[1]), record_at(at[2]), record_at(at[3]))
        if status != GOES_ON:
            shared.who = i
            return status
    return GOES_ON


@compiled
def _move_ports(shared: Shared, k: int) -> int:
    """Forces are forgotten before any port moves: what moves it is one of them."""
    _all(shared, CLEARED, k)
    status = _all(shared, MOVED, k)
    if status == GOES_ON:
        mj_step1(shared.mj_model, shared.mj_data)
    return status


@compiled
def begin_several(shared: Shared) -> int:
    """The first instant of a run, as `surgsim.plant.period.begin`."""
    if shared.kinematic:
        mj_kinematics(shared.mj_model, shared.mj_data)
        return _all(shared, SEEN, 0)
    status = _move_ports(shared, 0)
    if status != GOES_ON:
        return status
    _all(shared, HELD, 0)
    return _all(shared, SEEN, 0)


@compiled
def advance_several(shared: Shared) -> int:
    """Let every arm's commands act for one control period, as `surgsim.plant.period.advance_dynamics`.

    Where arms follow velocities it is as `surgsim.plant.kinematic.advance_kinematics`.
    """
    status = _all(shared, COMMANDED, 0)
    if shared.kinematic:
        mj_kinematics(shared.mj_model, shared.mj_data)
        return _all(shared, SEEN, 0)
    for k in range(shared.substeps):
        if k > 0 and status == GOES_ON:
            status = _move_ports(shared, k)
        if status == GOES_ON:
            status = _all(shared, PUSHED, k)
        if status != GOES_ON:
            return status
        mj_step2(shared.mj_model, shared.mj_data)
        status = _all(shared, STEPPED, k)
    if status != GOES_ON:
        return status
    _all(shared, ENDED, 0)
    status = _move_ports(shared, 0)
    return status if status != GOES_ON else _all(shared, SEEN, 0)


class SeveralPlants:
    """The plants of arms that share a model.

    Args:
        plants: One for each arm, all on the same data and of one kind.

    Attributes:
        record: What the kernels work on.
    """

    def __init__(self, plants: Sequence[SharedPlant]) -> None:
        self._plants = tuple(plants)
        first = self._plants[0]
        self._model, self._data = first.scene.model, first.data
        self._table = np.array([_entry(plant) for plant in self._plants], dtype=np.int64)
        self.record = shared = new(Shared, 0)
        shared.mj_model, shared.mj_data = self._model._address, self._data._address
        shared.table, shared.count = self._table.ctypes.data, len(self._plants)
        shared.substeps, shared.kinematic = first.world.substeps, isinstance(first, KinematicPlant)
        self._begin = as_parameter(begin_several, shared_signature())

    def reset(self, starts: Sequence[Array]) -> None:
        """Put every arm at rest at its joint positions (n,) [rad], and forget the last run.

        Raises:
            SurgsimError: If a part cannot begin there.
        """
        mujoco.mj_resetData(self._model, self._data)
        for plant, q in zip(self._plants, starts, strict=True):
            plant.pose(q)
        for plant in self._plants:
            plant.forget()
        status = self._begin(self.record)
        if status != GOES_ON:
            raise self.raised() or SurgsimError(f"a disturbance told status {status}")

    def raised(self) -> BaseException | None:
        """What a part in Python raised."""
        return next((error for plant in self._plants if (error := plant.hooks.raised())), None)


def _entry(plant: SharedPlant) -> list[int]:
    stages = of_several_kinematic if isinstance(plant, KinematicPlant) else of_several
    kernel = address_of(stages, stage_signature(plant.world.q.size))
    return [kernel, *(place_of(record) for record in (plant.world, plant.bore, plant.hooks.record))]
