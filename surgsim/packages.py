"""Packages that the small installation leaves out, and what is said where one is missing."""

import importlib.util
import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, distribution

from surgsim.errors import SurgsimError

_PLAIN, _SMALL = "surgsim", "surgsim-core"
PACKAGES: Mapping[str, tuple[str, str]] = {
    "PIL": ("pillow", _PLAIN),
    "av": ("PyAV", "'surgsim[video]'"),
    "dm_control": ("dm-control", _PLAIN),
    "dm_env": ("dm-env", _PLAIN),
    "glfw": ("glfw", _PLAIN),
    "gymnasium": ("gymnasium", "'surgsim[gymnasium]'"),
    "matplotlib": ("matplotlib", _PLAIN),
    "mink": ("mink", _PLAIN),
    "OpenGL": ("pyopengl", _PLAIN),
    "osqp": ("osqp", _PLAIN),
    "pandas": ("pandas", "'surgsim[pandas]'"),
    "pyarrow": ("pyarrow", _PLAIN),
    "qpsolvers": ("qpsolvers", _PLAIN),
    "ray": ("ray", "'surgsim[ray]'"),
    "rerun": ("rerun-sdk", _PLAIN),
}
"""By the module that is imported: the package that has it, and what pip is to install for it."""


RECORDING = ("rerun", "pyarrow")
"""What writes and reads recordings."""
ENVIRONMENT = ("dm_control", "dm_env")
"""What learning environments are made of."""


class MissingPackageError(SurgsimError):
    """Something that needs a package which is not installed."""


def require(what: str, *modules: str, otherwise: str = "") -> None:
    """Refuse what a module is missing for, in a line that says how to get it; nothing is imported.

    Args:
        what: How the line begins: `recordings need`.
        modules: Names out of `PACKAGES`.
        otherwise: What a person can do without it: `--no-record`.

    Raises:
        MissingPackageError: For the first that is missing.
    """
    if line := lacking(what, *modules, otherwise=otherwise):
        raise MissingPackageError(line)


def lacking(what: str, *modules: str, otherwise: str = "") -> str:
    """The line of `require`, empty where nothing is missing."""
    return next((_line(what, name, otherwise) for name in modules if not installed(name)), "")


def installed(module: str) -> bool:
    """Whether there is a module, without importing it."""
    try:
        return importlib.util.find_spec(module) is not None
    except (ModuleNotFoundError, ValueError):  # one that is being imported has no spec yet
        return module in sys.modules


def missing(error: ModuleNotFoundError) -> MissingPackageError | None:
    """What to say of an import that failed; None if it is of no package of `PACKAGES`."""
    name = error.name or ""
    while name:
        if name in PACKAGES:
            return MissingPackageError(_line("this needs", name))
        name = name.rpartition(".")[0]
    return None


def _line(what: str, module: str, otherwise: str = "") -> str:
    """`recordings need rerun-sdk: pip install surgsim, or --no-record`."""
    package, source = PACKAGES[module]
    if _small():
        extra = source.startswith("'")
        source = source.replace("surgsim", _SMALL) if extra else f"{source} (pip uninstall {_SMALL} first)"
    return f"{what} {package}: pip install {source}" + (f", or {otherwise}" if otherwise else "")


def _small() -> bool:
    """Whether this is the small installation."""
    try:
        distribution(_SMALL)
    except PackageNotFoundError:
        return False
    return True
