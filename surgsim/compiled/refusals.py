"""What a kernel says of an array that does not fit into the slice that it is assigned to: a short text.

numba's names both sizes. The code for strings that puts it together takes seconds to compile in each process,
a sixth of what a controller takes from cold, and is compiled into every kernel that assigns an array.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.compiler_lock import global_compiler_lock
from numba.extending import overload
from numba.np import arrayobj


def _sizes_differ(given: Any, slots: Any) -> None:
    """Refuse an array of the sizes `given` for a slice of the sizes `slots`."""


@overload(_sizes_differ)
def _sizes_differ_in_kernels(given: Any, slots: Any) -> Any:
    def refuse(given: Any, slots: Any) -> None:
        raise ValueError("cannot assign an array to a slice of another size")

    return refuse


@contextmanager
def short_refusals() -> Iterator[None]:
    """Have what is compiled meanwhile refuse shortly; what others compile with numba stays as it is."""
    with global_compiler_lock:
        before = arrayobj.raise_with_shape_context
        arrayobj.raise_with_shape_context = _sizes_differ
        try:
            yield
        finally:
            arrayobj.raise_with_shape_context = before
