"""Where a result comes from: versions, sources, machine, commit."""

import hashlib
import json
import os
import platform
import subprocess
from collections.abc import Mapping
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import surgsim
from surgsim.runs.part_origins import externals_of, plugins_of, policies_of
from surgsim.runs.sources import LATER_ROOMS, ROOT, sources_sha256
from surgsim.scenario.arms import Experiment

_PACKAGES = ("mujoco", "numpy", "scipy", "mink", "daqp", "qpsolvers", "osqp", "rerun-sdk")
"""Those that are installed are told."""
_HELD_BY = {"mujoco": "mujoco-core"}
"""The distribution that has the modules, where it is another one: the small installation has it alone."""
_OF_NO_CONSEQUENCE = frozenset({"rerun-sdk"})
_THAT_COUNT = ("surgsim/*.py", "assets", *(f":(exclude)surgsim/{room}" for room in LATER_ROOMS))


@lru_cache(maxsize=1)
def provenance() -> dict[str, Any]:
    """Versions of surgsim, Python and the numerical packages, the machine, the sources and their commit.

    Found once a process: git takes longer than a short run. The hash of the sources tells which code it is
    where there is no git, or where git refuses.
    """
    return {
        "surgsim": surgsim.__version__,
        "python": platform.python_version(),
        "packages": {name: found for name in _PACKAGES if (found := _version(name))},
        "machine": f"{platform.system()} {platform.machine()}",
        "sources_sha256": sources_sha256(),
        "commit": commit_of(ROOT.parent),
    }


def provenance_of(scenario: Experiment) -> dict[str, Any]:
    """Provenance of a run of `scenario`: as `provenance`, with the packages that gave it a part.

    `code_sha256` is one hash of all that a result follows from beside its scenario: the sources of surgsim
    and of these packages, the policy's file, the versions of the numerical packages.
    """
    parts = {"plugins": plugins_of(scenario), "policies": policies_of(scenario)}
    told = {**provenance(), **parts, "externals": externals_of(scenario)}
    return {**told, "code_sha256": code_sha256(told), "scenario_sha256": scenario.sha256()}


def code_sha256(told: Mapping[str, Any]) -> str:
    """One hash of all that a result follows from beside its scenario.

    Args:
        told: `sources_sha256`, `packages`, `plugins`, `policies` and `externals`, as in `provenance_of`.
    """
    packages = {name: told["packages"][name] for name in told["packages"] if name not in _OF_NO_CONSEQUENCE}
    code = [told["sources_sha256"], packages, told["plugins"], told["policies"], told["externals"]]
    return hashlib.sha256(json.dumps(code, sort_keys=True).encode()).hexdigest()


def code_difference(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """What of the code of two runs is different, in words: `sources of surgsim, mujoco 4.0.0 not 4.0.1`."""
    words = [] if old["sources_sha256"] == new["sources_sha256"] else ["sources of surgsim"]
    before, now = old["packages"], new["packages"]
    names = sorted((before.keys() | now.keys()) - _OF_NO_CONSEQUENCE)
    words += [f"{n} {before.get(n)} not {now.get(n)}" for n in names if before.get(n) != now.get(n)]
    for kind, word in (("plugins", "package"), ("policies", "policy"), ("externals", "external controller")):
        names = sorted(old[kind].keys() | new[kind].keys())
        words += [f"{word} {name}" for name in names if old[kind].get(name) != new[kind].get(name)]
    return ", ".join(words)


def _version(name: str) -> str | None:
    try:
        return version(_HELD_BY.get(name, name))
    except PackageNotFoundError:
        return None


def commit_of(root: Path) -> str | None:
    """Commit of the checkout at `root`, None if it is none.

    Local changes of what can change a result are added as `+dirty.` and the start of their hash: those of
    tracked modules and assets, and new ones that git does not ignore.
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
