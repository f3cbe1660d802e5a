"""Compilation of the hot loop's kernels.

Laws are pure functions of arrays, so they compile as they stand. Compiled code is cached beside the
source (or in the user's cache folder), so that only the first run on a machine pays for it.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function of arrays and numbers at its first call; IEEE arithmetic is kept as written."""
    return cast(Function, numba.njit(cache=True)(function))
