"""Where a result comes from: versions, machine, commit."""

import hashlib
import os
import platform
import subprocess
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import surgsim

_PACKAGES = ("mujoco", "numpy", "scipy", "mink", "daqp", "qpsolvers", "osqp", "rerun-sdk")
_THAT_COUNT = ("surgsim", "assets", "scenarios", "pyproject.toml")


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
    """Commit of the checkout that surgsim runs from; None when it was installed."""
    return commit_of(Path(surgsim.__file__).resolve().parents[1])


def commit_of(root: Path) -> str | None:
    """Commit of the checkout at `root`, None if it is none.

    Local changes of what can change a result are added as `+dirty.` and the start of their hash: those of
    tracked files, and new files that git does not ignore.
    """
    if not (root / ".git").exists():
        return None
    commit = _git(root, "rev-parse", "HEAD")
    if not commit:
        return None
    changes = _git(root, "diff", "HEAD", "--binary", "--no-ext-diff", "--no-color", "--", *_THAT_COUNT)
    added = _git(root, "ls-files", "--others", "--exclude-standard", "-z", "--", *_THAT_COUNT)
    if changes is None or added is None:
        return f"{commit.decode().strip()}+dirty.unknown"
    if not (changes or added):
        return commit.decode().strip()
    sha = hashlib.sha256(changes)
    for name in sorted(filter(None, added.split(b"\0"))):
        path = root / os.fsdecode(name)
        sha.update(name + b"\0" + (path.read_bytes() if path.is_file() else b"") + b"\0")
    return f"{commit.decode().strip()}+dirty.{sha.hexdigest()[:8]}"


def _git(root: Path, *words: str) -> bytes | None:
    """What git says, None if it fails."""
    try:
        done = subprocess.run(["git", *words], cwd=root, capture_output=True, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout if done.returncode == 0 else None
