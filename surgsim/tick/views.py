"""MuJoCo's arrays as kernels see them: by the address of their first entry."""

import ctypes
from typing import Any

import numba
import numpy as np
from numba import carray, types  # type: ignore[attr-defined]
from numba.core import cgutils
from numba.extending import intrinsic, overload

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.algebra import cross
from surgsim.tick.arrays import Ids, Numbers, Record, World
from surgsim.tick.scratch import scratch


@intrinsic
def _pointer(context: Any, address: Any) -> Any:
    """The address as a pointer."""

    def generate(_: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], cgutils.voidptr_t)

    return types.voidptr(types.int64), generate


_KEPT: dict[int, Record] = {}


def place_of(record: Record) -> int:
    """The address of a record, for `record_at`; whoever holds it must hold the record too."""
    address = int(np.asarray(record.base).ctypes.data)
    if vars(numba.config)["DISABLE_JIT"]:
        _KEPT[address] = record
    return address


def record_at(address: int) -> Record:
    """The record at an address, to be handed on to a kernel that knows its kind."""
    return _KEPT[address]


@overload(record_at)
def _record_at(address: Any) -> Any:
    def pointer(address: Any) -> Any:
        return _pointer(address)  # type: ignore[call-arg]

    return pointer


def doubles(address: int, rows: int, columns: int) -> Array:
    """The doubles at `address` as an array (rows, columns), not copied."""
    pointer = ctypes.cast(int(address), ctypes.POINTER(ctypes.c_double))
    return np.ctypeslib.as_array(pointer, (int(rows), int(columns)))


@overload(doubles)
def _doubles(address: Any, rows: Any, columns: Any) -> Any:
    def view(address: Any, rows: Any, columns: Any) -> Any:
        return carray(_pointer(address), (rows, columns), np.float64)  # type: ignore[call-arg]

    return view


def words(address: int, size: int) -> Ids:
    """The 64-bit integers at `address` as an array (size,), not copied."""
    pointer = ctypes.cast(int(address), ctypes.POINTER(ctypes.c_int64))
    return np.ctypeslib.as_array(pointer, (int(size),))


@overload(words)
def _words(address: Any, size: Any) -> Any:
    def view(address: Any, size: Any) -> Any:
        return carray(_pointer(address), (size,), np.int64)  # type: ignore[call-arg]

    return view


def integers(address: int, size: int) -> Any:
    """The C integers at `address` as an array (size,), not copied."""
    pointer = ctypes.cast(int(address), ctypes.POINTER(ctypes.c_int32))
    return np.ctypeslib.as_array(pointer, (int(size),))


@overload(integers)
def _integers(address: Any, size: Any) -> Any:
    def view(address: Any, size: Any) -> Any:
        return carray(_pointer(address), (size,), np.int32)  # type: ignore[call-arg]

    return view


def octets(address: int, size: int) -> Any:
    """The bytes at `address` as an array (size,), not copied."""
    pointer = ctypes.cast(int(address), ctypes.POINTER(ctypes.c_uint8))
    return np.ctypeslib.as_array(pointer, (int(size),))


@overload(octets)
def _octets(address: Any, size: Any) -> Any:
    def view(address: Any, size: Any) -> Any:
        return carray(_pointer(address), (size,), np.uint8)  # type: ignore[call-arg]

    return view


@compiled
def numbers(where: Numbers) -> Array:
    """The array that is there (length,), not copied."""
    return vector(where.address, where.length)


@compiled
def vector(address: int, size: int) -> Array:
    """The doubles at `address` as an array (size,), not copied."""
    place: Array = doubles(address, 1, size)[0]
    return place


@compiled
def applied_wrench(world: World, body: int) -> Array:
    """Applied force and torque on a body (6,) [N, N m], about its centre of mass, world frame."""
    place: Array = doubles(world.xfrc_applied, world.nbody, 6)[body]
    return place


@compiled
def push_at(world: World, body: int, point: Array, force: Array) -> None:
    """Add a force (3,) [N] on a body at a point (3,) [m], with its moment about the centre of mass."""
    wrench, centre = applied_wrench(world, body), centre_of_mass(world, body)
    arm, moment = scratch(3), scratch(3)
    for i in range(3):
        arm[i] = point[i] - centre[i]
    cross(arm, force, moment)
    for i in range(3):
        wrench[i] += force[i]
        wrench[3 + i] += moment[i]


@compiled
def body_place(world: World, body: int) -> Array:
    """Place of a body (3,) [m]."""
    place: Array = doubles(world.xpos, world.nbody, 3)[body]
    return place


@compiled
def centre_of_mass(world: World, body: int) -> Array:
    """Centre of mass of a body (3,) [m]."""
    place: Array = doubles(world.xipos, world.nbody, 3)[body]
    return place


@compiled
def site_place(world: World, site: int) -> Array:
    """Place of a site (3,) [m]."""
    place: Array = doubles(world.site_xpos, world.nsite, 3)[site]
    return place


@compiled
def site_turn(world: World, site: int) -> Array:
    """Orientation of a site (9,), row by row."""
    place: Array = doubles(world.site_xmat, world.nsite, 9)[site]
    return place
