"""A Python part as a kernel of the compiled loop.

The loop knows kernels alone. For a part that is Python by nature it is given a trampoline, whose gains hold
the address of a C function that enters Python. The part shares its arrays with the loop, so nothing is
handed over but the call. An exception cannot pass through compiled code: it is kept, the tick ends with a
status, and whoever runs the loop raises it again.
"""

import ctypes
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.status import GOES_ON, TOLD

_CALL = ctypes.CFUNCTYPE(ctypes.c_int64)


class PythonPart:
    """Enters Python from a compiled loop, and keeps what went wrong there.

    Args:
        call: What is called each time; it returns a status, or None for `GOES_ON`.
        status_of: The status that stands for an exception; `TOLD` unless given.

    Attributes:
        gains: The trampoline's gains: the address of the C function (1,).
        error: What `call` raised, until it is taken by `raised` or entered again.
    """

    def __init__(
        self, call: Callable[[], int | None], status_of: Callable[[BaseException], int] = lambda _: TOLD
    ) -> None:
        self._call, self._status_of = call, status_of
        self._entry = _CALL(self._enter)
        address = ctypes.cast(self._entry, ctypes.c_void_p).value
        self.gains: Array = np.array([address], dtype=np.int64).view(np.float64)
        self.error: BaseException | None = None

    def _enter(self) -> int:
        self.error = None
        try:
            status = self._call()
        except BaseException as error:  # an exception that leaves here is printed and lost
            self.error = error
            return self._status_of(error)
        return GOES_ON if status is None else int(status)

    def raised(self) -> BaseException | None:
        """The exception of the last time that it was entered, once."""
        error, self.error = self.error, None
        return error


def first_raised(parts: Iterable[PythonPart]) -> BaseException | None:
    """What the first of them raised that raised something; it is taken from all."""
    errors = [part.raised() for part in parts]
    return next((error for error in errors if error is not None), None)


@intrinsic
def _enter_address(context: Any, address: Any) -> Any:
    """Call the C function `int64 f(void)` at an address that is stored in the bits of a float."""

    def generate(_: Any, builder: Any, signature: Any, values: Any) -> Any:
        function = ir.FunctionType(ir.IntType(64), [])
        bits = builder.bitcast(values[0], ir.IntType(64))
        return builder.call(builder.inttoptr(bits, function.as_pointer()), [])

    return types.int64(types.float64), generate


def _enter_part(bits: float) -> int:
    """The same in Python."""
    return int(_CALL(int(np.float64(bits).view(np.int64)))())


@overload(_enter_part)
def _enter_part_in_kernels(bits: Any) -> Any:
    def enter(bits: Any) -> Any:
        return _enter_address(bits)  # type: ignore[call-arg]

    return enter


@compiled
def enter(entry: Array) -> int:
    """Enter a Python part within a kernel, by its `PythonPart.gains`; its status."""
    return _enter_part(entry[0])


@compiled
def python_kernel(gains: Any, seen: Any, memory: Any, out: Any) -> int:
    """The trampoline of every kind of kernel: ask the Python part whose address is the first gain."""
    return _enter_part(gains[0])
