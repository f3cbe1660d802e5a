"""Compilation of the hot loop's kernels.

Laws are pure functions of arrays, so they compile as they stand. Compiled code is cached beside the
source (or in the user's cache folder), so that only the first run on a machine pays for it.
"""

import warnings
from collections.abc import Callable
from typing import Any, TypeVar, cast, overload

import numba
from numba.core.errors import NumbaExperimentalFeatureWarning

warnings.filterwarnings("ignore", category=NumbaExperimentalFeatureWarning)  # functions as parameters

Function = TypeVar("Function", bound=Callable[..., Any])


@overload
def compiled(signature: Function) -> Function: ...
@overload
def compiled(signature: Any) -> Callable[[Function], Function]: ...
def compiled(signature: Any) -> Any:
    """Compile a function of arrays and numbers; IEEE arithmetic is kept as written.

    As `@compiled` it is compiled at its first call, for the types that it is given. As
    `@compiled(SIGNATURE)` it is compiled, or loaded from the cache, for that signature at once, so that
    it can be handed to a compiled loop as a parameter. Neither holds Python's lock.
    """
    if callable(signature) and not isinstance(signature, numba.core.typing.templates.Signature):
        return cast(Any, numba.njit(cache=True, nogil=True, error_model="numpy")(signature))
    return numba.njit(signature, cache=True, nogil=True, error_model="numpy")


_AS_PARAMETERS: dict[tuple[Any, Any], Any] = {}


def as_parameter(kernel: Any, signature: Any) -> Any:
    """The `@compiled` function as a parameter of the type `FunctionType(signature)` of a compiled function.

    It is compiled for this signature, or loaded from the cache, when it is first asked for.
    """
    key = (kernel.py_func, signature)
    if key not in _AS_PARAMETERS:
        _AS_PARAMETERS[key] = compiled(signature)(kernel.py_func)
    return _AS_PARAMETERS[key]
