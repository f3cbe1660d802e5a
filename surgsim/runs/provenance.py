"""Where a result comes from: versions, machine, commit."""

import platform
import subprocess
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import surgsim

_PACKAGES = ("mujoco", "numpy", "scipy", "mink", "daqp", "qpsolvers", "osqp", "rerun-sdk")


@lru_cache(maxsize=1)
def provenance() -> dict[str, Any]:
    """Versions of surgsim, Python and the numerical packages, the machine, and the checkout's commit.

    Found once a process: git takes longer than a short run.
    """
    return {
        "surgsim": surgsim.__version__,
        "python": platform.python_version(),
        "packages": {name: found for name in _PACKAGES if (found := _version(name))},
        "machine": f"{platform.system()} {platform.machine()}",
        "commit": _commit(),
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _commit() -> str | None:
    """Commit of the checkout that surgsim runs from, `+dirty` with local changes; None when installed."""
    root = Path(surgsim.__file__).resolve().parents[1]
    if not (root / ".git").exists():
        return None

    def git(*words: str) -> str | None:
        try:
            done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, timeout=10)
        except (OSError, subprocess.TimeoutExpired):
            return None
        return done.stdout.strip() if done.returncode == 0 else None

    commit = git("rev-parse", "HEAD")
    if not commit:
        return None
    return f"{commit}+dirty" if git("status", "--porcelain") else commit
