"""A controller that is a C function of a shared library, called in the loop itself."""

import ctypes
from pathlib import Path

from surgsim.control.external.declared import Declared, read_declaration
from surgsim.control.external.layout import declaration
from surgsim.errors import SurgsimError

DECLARE = "_declare"
"""Added to the function's name: the function that is told the hello and writes the declaration."""


class Library:
    """A loaded function and its declaration.

    Args:
        who: What messages call it. file: The shared library. name: The function `int64_t name(const
        surgsim_request *, double *memory, double *answer)`; beside it must
            be `int64_t name_declare(const surgsim_hello *, const char *text, surgsim_declaration *)`.

    Raises:
        SurgsimError: If the library cannot be loaded, or lacks a function.
    """

    def __init__(self, who: str, file: Path, name: str) -> None:
        self._who = who
        try:
            self._loaded = ctypes.CDLL(str(file))
        except OSError as error:
            raise SurgsimError(f"{who} cannot be loaded: {' '.join(str(error).split())}") from error
        try:
            self._function, self._declare = (getattr(self._loaded, each) for each in (name, name + DECLARE))
        except AttributeError as error:
            raise SurgsimError(
                f"{who}: {file} needs the functions {name} and {name}{DECLARE}: {error}"
            ) from error

    @property
    def address(self) -> int:
        """Where the function is."""
        return ctypes.cast(self._function, ctypes.c_void_p).value or 0

    def greet(self, head: bytes, text: bytes) -> Declared:
        """Tell it the hello, and read what it declares.

        Raises:
            SurgsimError: If it refuses, or what it says is no declaration.
        """
        answer = ctypes.create_string_buffer(declaration().dtype.itemsize)
        self._declare.restype = ctypes.c_int64
        status = self._declare(ctypes.create_string_buffer(head), ctypes.create_string_buffer(text), answer)
        if status != 0:
            raise SurgsimError(f"{self._who} refuses the arm: its declaration returned {status}")
        return read_declaration(answer.raw, self._who)
