"""The state of Python objects, taken from the parts of one run and put back into those of another.

Objects are pickled. What belongs to the run itself (its models, its records) and what does not change (its
functions or classes) is not copied but named, and found again where the state is put back: no address of the
one run gets into the other. Objects stay the ones that they are; arrays and containers in them are replaced,
unless the memory is shared or MuJoCo's.
"""

import io
import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from types import FunctionType, MethodType, ModuleType
from typing import Any

import mujoco
import numpy as np
from numba.core.dispatcher import Dispatcher
from numpy.typing import NDArray
from pydantic import BaseModel

from surgsim.errors import SurgsimError

_CONSTANT = (FunctionType, ModuleType, type, Dispatcher, BaseModel, mujoco.MjModel)


@dataclass(frozen=True, kw_only=True)
class Stored:
    """The state of objects.

    Attributes:
        content: Pickled, but for what is named.
        constants: Functions, classes and configs in it.
    """

    content: bytes
    constants: tuple[Any, ...]


def store(objects: Mapping[str, Any], shared: Mapping[str, Any]) -> Stored:
    """The state of `objects`; what is `shared` is named in it.

    Raises:
        SurgsimError: If an object's state cannot be copied; it is named.
    """
    try:
        return _stored(dict(objects), shared)
    except Exception:
        for name, part in objects.items():
            try:
                _stored(part, shared)
            except Exception as error:
                raise SurgsimError(
                    f"{name}: a run with it cannot be stored, its state cannot be copied: {error}"
                ) from error
        raise


def put_back(objects: Mapping[str, Any], stored: Stored, shared: Mapping[str, Any]) -> None:
    """Give `objects` the state that is `stored`."""
    found = _Unpickler(io.BytesIO(stored.content), stored.constants, shared).load()
    walk = _Return(shared)
    for name, now in objects.items():
        if isinstance(now, dict):
            content = {key: walk.into(now.get(key), value) for key, value in found[name].items()}
            now.clear()
            now.update(content)
        else:
            walk.into(now, found[name])


def _stored(objects: Any, shared: Mapping[str, Any]) -> Stored:
    file = io.BytesIO()
    pickler = _Pickler(file, shared)
    pickler.dump(objects)
    return Stored(content=file.getvalue(), constants=tuple(pickler.constants))


class _Pickler(pickle.Pickler):
    def __init__(self, file: io.BytesIO, shared: Mapping[str, Any]) -> None:
        super().__init__(file, protocol=4)
        self._shared = {id(value): name for name, value in shared.items()}
        self._places: dict[int, int] = {}
        self.constants: list[Any] = []

    def persistent_id(self, given: Any) -> Any:
        name = self._shared.get(id(given))
        if name is not None:
            return name
        if not isinstance(given, _CONSTANT):
            return None
        if id(given) not in self._places:
            self._places[id(given)] = len(self.constants)
            self.constants.append(given)
        return self._places[id(given)]

    def reducer_override(self, given: Any) -> Any:
        """A part of another array stays one: pickle would make two arrays of them."""
        if type(given) is not np.ndarray or not isinstance(given.base, np.ndarray):
            return NotImplemented
        whole = given.base
        if not whole.flags.c_contiguous or whole.dtype.hasobject:
            return NotImplemented
        return _view, (whole, _offset(given), given.shape, given.strides, given.dtype)


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, constants: tuple[Any, ...], shared: Mapping[str, Any]) -> None:
        super().__init__(file)
        self._constants, self._shared = constants, shared

    def persistent_load(self, name: Any) -> Any:
        return self._shared[name] if isinstance(name, str) else self._constants[name]


def _offset(part: NDArray[Any]) -> int:
    assert isinstance(part.base, np.ndarray)
    return int(part.ctypes.data - part.base.ctypes.data)


def _view(
    whole: NDArray[Any], offset: int, shape: tuple[int, ...], strides: tuple[int, ...], dtype: np.dtype[Any]
) -> NDArray[Any]:
    """A part of an array."""
    return np.ndarray(shape, dtype, buffer=whole, offset=offset, strides=strides)


class _Return:
    """Walks through objects as they are and as they were stored, side by side."""

    def __init__(self, shared: Mapping[str, Any]) -> None:
        self._done: dict[int, Any] = {}
        self._taken: dict[int, Any] = {}
        self._shared = {id(value) for value in shared.values()}

    def into(self, now: Any, stored: Any) -> Any:
        """What is to stand where `stored` stands: `now` with its state, where that can be."""
        if id(stored) in self._done:
            return self._done[id(stored)]
        if now is stored or id(stored) in self._shared:
            return stored
        fits = type(now) is type(stored) and id(now) not in self._taken and id(now) not in self._shared
        same = now if fits else None
        if isinstance(stored, MethodType):
            return MethodType(stored.__func__, self._done.get(id(stored.__self__), stored.__self__))
        if isinstance(stored, _CONSTANT):
            return now if _same_code(now, stored) else stored
        if isinstance(stored, np.ndarray):
            return self._array(same, stored)
        if isinstance(stored, mujoco.MjData) and fits:
            mujoco.mj_copyData(now, now.model, stored)
            return self._keep(now, stored)
        if isinstance(stored, dict):
            return self._dict(same, stored)
        if type(stored) in (list, tuple):
            return self._sequence(same, stored)
        return self._object(same, stored) if hasattr(stored, "__dict__") else stored

    def _keep(self, now: Any, stored: Any) -> Any:
        self._done[id(stored)] = self._taken[id(now)] = now
        return now

    def _array(self, now: Any, stored: NDArray[Any]) -> Any:
        if now is not None and _is_foreign(now) and now.shape == stored.shape:
            return now
        if not isinstance(stored.base, np.ndarray):
            return stored
        whole = self.into(None, stored.base)
        if whole is stored.base:
            return stored
        return _view(whole, _offset(stored), stored.shape, stored.strides, stored.dtype)

    def _dict(self, now: Any, stored: dict[Any, Any]) -> dict[Any, Any]:
        out = self._keep(stored, stored)
        old = {} if now is None else dict(now)
        for key, value in list(stored.items()):
            out[key] = self.into(old.get(key), value)
        return stored

    def _sequence(self, now: Any, stored: Any) -> Any:
        pairs = now if now is not None and len(now) == len(stored) else (None,) * len(stored)
        if isinstance(stored, tuple):
            return tuple(self.into(a, b) for a, b in zip(pairs, stored, strict=True))
        self._keep(stored, stored)
        stored[:] = [self.into(a, b) for a, b in zip(pairs, list(stored), strict=True)]
        return stored

    def _object(self, now: Any, stored: Any) -> Any:
        parameters: Any = getattr(type(stored), "__dataclass_params__", None)
        frozen = parameters is not None and parameters.frozen
        out = stored if now is None or frozen else now
        self._keep(out, stored)
        old = {} if now is None else dict(vars(now))
        fields = {name: self.into(old.get(name), value) for name, value in list(vars(stored).items())}
        vars(out).clear()
        vars(out).update(fields)
        return out


def _is_foreign(given: NDArray[Any]) -> bool:
    """Whether an array's memory is not Python's and is writable: MuJoCo's, which has a state of its own."""
    whole = given
    while isinstance(whole.base, np.ndarray):
        whole = whole.base
    return whole.base is not None and whole.flags.writeable and not isinstance(whole.base, bytes | bytearray)


def _same_code(now: Any, stored: Any) -> bool:
    return (
        isinstance(now, FunctionType) and isinstance(stored, FunctionType) and now.__code__ is stored.__code__
    )
