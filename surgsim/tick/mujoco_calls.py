"""MuJoCo's C functions, callable from compiled code by their symbols.

`m` and `d` are the addresses of model and data; whoever holds them must hold the objects too.
"""

import ctypes
from pathlib import Path
from typing import Any

import llvmlite.binding
import mujoco
import numba
from numba import types

_SYMBOLS = (
    "mj_step1",
    "mj_step2",
    "mj_kinematics",
    "mj_comPos",
    "mj_comVel",
    "mj_makeM",
    "mj_fullM",
    "mj_rne",
    "mj_rnePostConstraint",
    "mj_jacSite",
    "mj_mulM",
    "mj_objectVelocity",
)


def _load() -> str:
    """Make the symbols of MuJoCo's own library known to compiled code; the library's file.

    Raises:
        ImportError: If the library is not beside MuJoCo's package, or lacks a symbol.
    """
    folder = Path(mujoco.__file__).parent
    found = sorted(
        [*folder.glob("libmujoco.so*"), *folder.glob("libmujoco*.dylib"), *folder.glob("mujoco.dll")]
    )
    if not found:
        raise ImportError(f"MuJoCo's library is not in {folder}")
    llvmlite.binding.load_library_permanently(str(found[0]))
    missing = [name for name in _SYMBOLS if not llvmlite.binding.address_of_symbol(name)]
    if missing:
        raise ImportError(f"{found[0]} has no {', '.join(missing)}; surgsim needs MuJoCo 4")
    return str(found[0])


_LIBRARY = _load()
_P, _I = types.intp, types.int32


def _function(name: str, *arguments: Any) -> Any:
    """A function of MuJoCo by its symbol; through ctypes where kernels run as Python (NUMBA_DISABLE_JIT)."""
    if not vars(numba.config)["DISABLE_JIT"]:
        return types.ExternalFunction(name, types.void(*arguments))
    function = getattr(ctypes.CDLL(_LIBRARY), name)
    function.argtypes = [ctypes.c_void_p if kind is _P else ctypes.c_int for kind in arguments]
    function.restype = None
    return lambda *values: function(*map(int, values))


mj_step1 = _function("mj_step1", _P, _P)
mj_step2 = _function("mj_step2", _P, _P)
mj_kinematics = _function("mj_kinematics", _P, _P)
mj_comPos = _function("mj_comPos", _P, _P)
mj_comVel = _function("mj_comVel", _P, _P)
mj_makeM = _function("mj_makeM", _P, _P)
mj_fullM = _function("mj_fullM", _P, _P, _P)
mj_rne = _function("mj_rne", _P, _P, _I, _P)
mj_rnePostConstraint = _function("mj_rnePostConstraint", _P, _P)
mj_jacSite = _function("mj_jacSite", _P, _P, _P, _P, _I)
mj_mulM = _function("mj_mulM", _P, _P, _P, _P)
mj_objectVelocity = _function("mj_objectVelocity", _P, _P, _I, _I, _P, _I)
