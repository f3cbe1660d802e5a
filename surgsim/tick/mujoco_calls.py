"""MuJoCo's C functions, callable from compiled code by their symbols.

`m` and `d` are the addresses of model and data; whoever holds them must hold the objects too.
"""

from pathlib import Path

import llvmlite.binding
import mujoco
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


def _load() -> None:
    """Make the symbols of MuJoCo's own library known to compiled code.

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


_load()
_P, _I = types.intp, types.int32
mj_step1 = types.ExternalFunction("mj_step1", types.void(_P, _P))
mj_step2 = types.ExternalFunction("mj_step2", types.void(_P, _P))
mj_kinematics = types.ExternalFunction("mj_kinematics", types.void(_P, _P))
mj_comPos = types.ExternalFunction("mj_comPos", types.void(_P, _P))
mj_comVel = types.ExternalFunction("mj_comVel", types.void(_P, _P))
mj_makeM = types.ExternalFunction("mj_makeM", types.void(_P, _P))
mj_fullM = types.ExternalFunction("mj_fullM", types.void(_P, _P, _P))
mj_rne = types.ExternalFunction("mj_rne", types.void(_P, _P, _I, _P))
mj_rnePostConstraint = types.ExternalFunction("mj_rnePostConstraint", types.void(_P, _P))
mj_jacSite = types.ExternalFunction("mj_jacSite", types.void(_P, _P, _P, _P, _I))
mj_mulM = types.ExternalFunction("mj_mulM", types.void(_P, _P, _P, _P))
mj_objectVelocity = types.ExternalFunction("mj_objectVelocity", types.void(_P, _P, _I, _I, _P, _I))
