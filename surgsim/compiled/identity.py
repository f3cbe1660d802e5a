"""What a compiled kernel depends on, as one hash: its key in the cache.

A kernel holds the code of every kernel that it calls, and the value of every global that it or they read, as
they were when it was compiled. So the key covers all of them, whatever file they stand in: the text of the
file of each function that is reached from the kernel, its byte code, and each value. A kernel that depends on
something that cannot be hashed is not cached.
"""

import dis
import hashlib
import platform
import sys
from enum import Enum
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core.extending import _Intrinsic
from numba.core.serialize import dumps
from numba.core.types import Type
from numba.core.typing.templates import Signature
from numba.extending import is_jitted

_KNOWN_TO_NUMBA = frozenset({"builtins", "cmath", "ctypes", "math", "numba", "numpy", "operator"})
_PLAIN = (type(None), type(...), bool, int, float, complex, str, bytes)
_SETTINGS = ("OPT", "BOUNDSCHECK", "LOOP_VECTORIZE", "SLP_VECTORIZE", "ENABLE_AVX")
_DECIDING = ("cache", "dispatcher", "kernel", "library")
_MOST_VALUES = 20_000


class UnknownValueError(Exception):
    """A kernel depends on something of which nobody can tell whether it changed."""


def identity(dispatcher: Any, signature: Any, machine: Any) -> str:
    """Key of a kernel compiled for `signature` and for `machine`, numba's description of the processor.

    Raises:
        UnknownValueError: If the kernel depends on a value that cannot be hashed.
    """
    walk = _Walk()
    walk.put("for", repr((_surroundings(), machine)))
    walk.value(signature)
    walk.value(dispatcher)
    return walk.hexdigest()


def _surroundings() -> tuple[Any, ...]:
    """Versions and settings of the compilers, and what of this folder decides on the code."""
    here = (file_hash(str(Path(__file__).with_name(f"{name}.py"))) for name in _DECIDING)
    versions = (numba.__version__, llvmlite.__version__, np.__version__, platform.python_version())
    settings = (getattr(numba.config, name) for name in _SETTINGS)
    return (*versions, getattr(sys, "abiflags", ""), *map(str, settings), *here)


class _Walk:
    """A hash of everything that is reached from a value, each thing once."""

    def __init__(self) -> None:
        self._sha = hashlib.sha256()
        self._seen: dict[int, tuple[int, Any]] = {}  # the value too, or its id may be given again

    def hexdigest(self) -> str:
        return self._sha.hexdigest()

    def put(self, *words: str | bytes) -> None:
        for word in words:
            content = word.encode("utf-8", "surrogatepass") if isinstance(word, str) else word
            self._sha.update(len(content).to_bytes(8, "little") + content)

    def value(self, value: Any) -> None:
        """Add a value of any kind."""
        if isinstance(value, _PLAIN):
            self.put(type(value).__name__, repr(value))
        elif id(value) in self._seen:
            self.put("again", str(self._seen[id(value)][0]))
        elif len(self._seen) >= _MOST_VALUES:
            raise UnknownValueError("too many values")
        else:
            self._seen[id(value)] = (len(self._seen), value)
            self._compound(value)

    def _compound(self, value: Any) -> None:
        if is_jitted(value):
            kernel: Any = value
            self.put("kernel", repr(sorted(kernel.targetoptions.items())))
            self._function(kernel.py_func)
        elif isinstance(value, _Intrinsic):  # its own pickle holds a number that is new in every process
            self.put("intrinsic")
            self._function(value._defn)
        elif isinstance(value, Type):
            self._type(value)
        elif isinstance(value, Signature):
            self._all("signature", (value.return_type, *value.args))
        elif isinstance(value, CodeType):
            self._code(value)
        elif isinstance(value, tuple | list):
            self._all(f"{type(value).__name__} {getattr(value, '_fields', '')}", value)
        elif isinstance(value, np.ndarray | np.generic):
            self._array(np.asarray(value))
        elif _known_to_numba(value):
            self.put("known", f"{value.__module__}.{value.__qualname__}")
        elif isinstance(value, FunctionType):
            self._function(value)
        elif isinstance(value, type):
            self._class(value)
        else:
            self._other(value)

    def _all(self, kind: str, values: Any) -> None:
        self.put(kind, str(len(values)))
        for value in values:
            self.value(value)

    def _function(self, function: FunctionType) -> None:
        code = function.__code__
        self.put("function", function.__module__ or "", function.__qualname__)
        self.put(file_hash(code.co_filename))
        self._all("defaults", function.__defaults__ or ())
        self.value(code)
        self._all("cells", [cell.cell_contents for cell in function.__closure__ or ()])
        for name in sorted(_globals(code) & function.__globals__.keys()):
            self._named(name, function.__globals__[name], _names(code))

    def _named(self, name: str, value: Any, names: frozenset[str]) -> None:
        """Add a global; of a module, those of its attributes that the code may read."""
        self.put("name", name)
        if not isinstance(value, ModuleType):
            self.value(value)
        elif value.__name__.partition(".")[0] in _KNOWN_TO_NUMBA:
            self.put("module", value.__name__)
        elif id(value) not in self._seen:
            self._seen[id(value)] = (len(self._seen), value)
            for attribute in sorted(names & vars(value).keys()):
                self._named(attribute, vars(value)[attribute], names)

    def _code(self, code: CodeType) -> None:
        self.put("code", code.co_code, repr((code.co_names, code.co_varnames, code.co_freevars)))
        self.put(repr((code.co_argcount, code.co_kwonlyargcount, code.co_flags)))
        self._all("constants", code.co_consts)

    def _array(self, array: Any) -> None:
        if array.dtype.hasobject:
            raise UnknownValueError("an array of objects")
        self.put("array", repr((array.dtype.descr, array.shape, array.flags.c_contiguous)), array.tobytes())

    def _type(self, value: Type) -> None:
        self.put("type", type(value).__name__, str(value))
        key = value.key if isinstance(value.key, tuple) else (value.key,)
        self._all("key", [part for part in key if isinstance(part, Type | Signature | type | tuple)])

    def _class(self, value: type) -> None:
        self.put("class", value.__module__, value.__qualname__, _module_hash(value.__module__))
        self.put(repr(getattr(value, "_fields", ())))
        if issubclass(value, Enum):
            self._all("members", [(member.name, member.value) for member in value])

    def _other(self, value: Any) -> None:
        self.put("other", type(value).__qualname__, _module_hash(type(value).__module__))
        try:
            self.put(dumps(value))
        except Exception as error:
            raise UnknownValueError(type(value).__qualname__) from error


def _known_to_numba(value: Any) -> bool:
    """Whether `value` is a function or class that numba has its own text of."""
    module = getattr(value, "__module__", None)
    named = isinstance(module, str) and hasattr(value, "__qualname__")
    return named and str(module).partition(".")[0] in _KNOWN_TO_NUMBA


def _names(code: CodeType) -> frozenset[str]:
    """Names of globals and attributes that `code` reads, in functions inside it too."""
    inner = (_names(constant) for constant in code.co_consts if isinstance(constant, CodeType))
    return frozenset(code.co_names).union(*inner)


@cache
def _globals(code: CodeType) -> frozenset[str]:
    """Names of globals that `code` reads, in functions inside it too."""
    inner = (_globals(constant) for constant in code.co_consts if isinstance(constant, CodeType))
    read = (item.argval for item in dis.get_instructions(code) if item.opname in ("LOAD_GLOBAL", "LOAD_NAME"))
    return frozenset(read).union(*inner)


@cache
def file_hash(path: str) -> bytes:
    """Hash of a source file; the same for all that are gone, whose byte code must do."""
    try:
        return hashlib.sha256(Path(path).read_bytes()).digest()
    except (OSError, ValueError):
        return b""


def _module_hash(name: str) -> bytes:
    if name.partition(".")[0] in _KNOWN_TO_NUMBA:
        return b""
    return file_hash(getattr(sys.modules.get(name), "__file__", None) or "")
