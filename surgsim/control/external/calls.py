"""C functions for the exchange: the system's by their names, an external controller's by its address."""

import ctypes
import time
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from surgsim.compiled import compiled

_P, _L, _I = types.intp, types.int64, types.int32
_IN_PYTHON = {_P: ctypes.c_void_p, _L: ctypes.c_int64, _I: ctypes.c_int32}
_MONOTONIC = getattr(time, "CLOCK_MONOTONIC", 1)
_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)


def _system(name: str, result: Any, *arguments: Any) -> Any:
    """A function of the C library; through ctypes where kernels run as Python (NUMBA_DISABLE_JIT)."""
    if not vars(numba.config)["DISABLE_JIT"]:
        return types.ExternalFunction(name, result(*arguments))
    function = getattr(ctypes.CDLL(None), name)
    function.argtypes, function.restype = [_IN_PYTHON[kind] for kind in arguments], _IN_PYTHON[result]
    return lambda *values: function(*map(int, values))


sys_write = _system("write", _L, _I, _P, _L)
"""Bytes written = write(file, address, bytes); below 0 where the other end is closed."""
sys_read = _system("read", _L, _I, _P, _L)
"""Bytes read = read(file, address, bytes); 0 where the other end is closed."""
sys_poll = _system("poll", _I, _P, _L, _I)
"""Files that are ready = poll(address of pollfd, how many, milliseconds); below 0 after a signal."""
_clock_gettime = _system("clock_gettime", _I, _I, _P)


@compiled
def monotonic() -> float:
    """A clock that only goes forward [s]."""
    now = np.zeros(2, dtype=np.int64)
    _clock_gettime(_MONOTONIC, now.ctypes.data)
    seconds: float = now[0] + 1e-9 * now[1]
    return seconds


@intrinsic
def _call_c(context: Any, address: Any, request: Any, memory: Any, answer: Any) -> Any:
    """Call the C function `int64 f(void *, void *, void *)` at an address."""

    def generate(_: Any, builder: Any, signature: Any, values: Any) -> Any:
        word = ir.IntType(64)
        function = ir.FunctionType(word, [word, word, word])
        return builder.call(builder.inttoptr(values[0], function.as_pointer()), values[1:])

    return types.int64(address, types.int64, types.int64, types.int64), generate


def call_c(address: int, request: int, memory: int, answer: int) -> int:
    """What the function at `address` returns, given the addresses of what it reads and writes."""
    return int(_FUNCTION(int(address))(int(request), int(memory), int(answer)))


@overload(call_c)
def _call_c_in_kernels(address: Any, request: Any, memory: Any, answer: Any) -> Any:
    def call(address: Any, request: Any, memory: Any, answer: Any) -> Any:
        return _call_c(address, request, memory, answer)  # type: ignore[call-arg]

    return call
