"""The decorator that makes a kernel of a function."""

import inspect
import warnings
from collections.abc import Callable
from typing import Any, TypeVar, cast, overload

import numba
from numba import types
from numba.core import cgutils
from numba.core.errors import NumbaExperimentalFeatureWarning, TypingError
from numba.core.typeinfer import register_dispatcher
from numba.extending import intrinsic, is_jitted
from numba.extending import overload as overload_function

from surgsim.compiled.cache import KernelCache
from surgsim.compiled.watch import declare

# Kernels are parameters of kernels: numba says so at every call with a tuple of them.
warnings.filterwarnings("ignore", "First-class function type", NumbaExperimentalFeatureWarning)

Function = TypeVar("Function", bound=Callable[..., Any])


@overload
def compiled(function: Function, /) -> Function: ...
@overload
def compiled(*signatures: Any) -> Callable[[Function], Function]: ...
def compiled(*given: Any) -> Any:
    """Compile a function of arrays and numbers; IEEE arithmetic is kept as written, the GIL is released.

    `@compiled` compiles at the first call, for the types that it is called with. `@compiled(SIGNATURE)`
    compiles, or loads what is kept, when its module is imported, and takes no other types. Such a kernel can
    be passed to another one as a parameter of the type `numba.types.FunctionType(SIGNATURE)`.

    Raises:
        numba.core.errors.NumbaError: If the function does not compile for a signature.
        TypeError: If what is decorated is no function.
    """
    if len(given) == 1 and inspect.isfunction(given[0]):
        return _kernel(given[0], ())
    return lambda function: _kernel(function, given)


def _kernel(function: Function, signatures: tuple[Any, ...]) -> Function:
    made: Any = numba.njit(nogil=True, error_model="numpy")(function)
    if not is_jitted(made):  # numba is told to leave Python functions alone
        return function
    dispatcher: Any = made
    dispatcher._cache = KernelCache(dispatcher)  # as `cache=True` would set numba's own
    declare()
    if signatures:
        with register_dispatcher(dispatcher):
            for signature in signatures:
                dispatcher.compile(signature)
        dispatcher.disable_compile()
    return cast(Function, dispatcher)


def address_of(kernel: Any, signature: Any) -> int:
    """Where the `@compiled` function is, compiled for this signature: what `call_at` calls."""
    parameter = as_parameter(kernel, signature)
    if not is_jitted(parameter):
        _IN_PYTHON[id(parameter)] = parameter
        return id(parameter)
    found: Any = parameter.get_compile_result(signature)
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


_AS_PARAMETERS: dict[tuple[Any, Any], Any] = {}


def as_parameter(kernel: Any, signature: Any) -> Any:
    """The `@compiled` function as a parameter of the type `numba.types.FunctionType(signature)`.

    It is compiled for this signature, or loaded, when it is first asked for; `@compiled(SIGNATURE)` would do
    so at import, when the number of joints is not yet known.
    """
    if not is_jitted(kernel):  # numba is told to leave Python functions alone
        return kernel
    key = (kernel.py_func, signature)
    if key not in _AS_PARAMETERS:
        _AS_PARAMETERS[key] = compiled(signature)(kernel.py_func)
    return _AS_PARAMETERS[key]
