"""The decorator that makes a kernel of a function."""

from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar, cast

import numba
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic, is_jitted
from numba.extending import overload as overload_function

from surgsim.compiled.dispatcher import Kernel
from surgsim.compiled.watch import declare

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function of arrays and numbers; IEEE arithmetic is kept as written, the GIL is released.

    It is compiled at the first call, for the types that it is called with.

    Raises:
        numba.core.errors.NumbaError: At that call, if the function does not compile for these types.
    """
    if vars(numba.config)["DISABLE_JIT"]:  # numba is told to leave Python functions alone
        return function
    declare()
    return cast(Function, Kernel(function))


def address_of(kernel: Any, signature: Any) -> int:
    """Where the `@compiled` function is, compiled for this signature: what `call_at` calls."""
    ours = _ours(kernel)
    if ours is None:
        _IN_PYTHON[id(kernel)] = kernel
        return id(kernel)
    found: Any = ours.within.for_signature(signature).get_compile_result(signature)
    address: int = found.library.get_pointer_to_function(found.fndesc.llvm_func_name)
    return address


_IN_PYTHON: dict[int, Callable[..., int]] = {}


@intrinsic
def _call_address(context: Any, address: Any, values: Any) -> Any:
    """Call what is at an address with the entries of a tuple; it returns a whole number."""
    kinds = tuple(values)
    for kind in kinds:  # what is called cannot say what it was compiled for
        if isinstance(kind, types.Array) and kind != types.Array(kind.dtype, kind.ndim, "C"):
            raise TypingError(f"call_at takes arrays that are whole and may be written, not {kind}")

    def generate(target: Any, builder: Any, signature: Any, given: Any) -> Any:
        result = signature.return_type
        function = target.call_conv.get_function_type(result, kinds)
        pointer = builder.inttoptr(given[0], function.as_pointer())
        arguments = cgutils.unpack_tuple(builder, given[1])
        status, out = target.call_conv.call_function(builder, pointer, result, kinds, arguments)
        with builder.if_then(status.is_error, likely=False):
            target.call_conv.return_status_propagate(builder, status)
        return out

    return types.int64(address, values), generate


def call_at(address: int, *values: Any) -> int:
    """Call the kernel at an address of `address_of`; its result is a status."""
    return _IN_PYTHON[address](*values)


@overload_function(call_at)
def _call_at_in_kernels(address: Any, *values: Any) -> Any:
    def call(address: Any, *values: Any) -> Any:
        return _call_address(address, values)  # type: ignore[call-arg]

    return call


def as_parameter(kernel: Any, signature: Any) -> Any:
    """The `@compiled` function for this signature alone, for Python; it is compiled, or loaded, now."""
    ours = _ours(kernel)
    return kernel if ours is None else ours.for_signature(signature)


def compile_for(kernel: Any, *arguments: Any) -> None:
    """Have the `@compiled` function ready for a call from Python with arguments of these types."""
    ours = _ours(kernel)
    if ours is not None:
        ours.compile(arguments)


def _ours(kernel: Any) -> Kernel | None:
    """The kernel, also of a function that numba itself was told to compile; None of a Python function."""
    if isinstance(kernel, Kernel) or not is_jitted(kernel):
        return kernel if isinstance(kernel, Kernel) else None
    return _of_numba(cast(Any, kernel).py_func)


@cache
def _of_numba(function: Callable[..., Any]) -> Kernel:
    return Kernel(function)
