"""Hashes of source files: which code a result comes from, whether or not there is git."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path

import surgsim
from surgsim.resources import resource_dir

ROOT = Path(surgsim.__file__).resolve().parent
LATER_ROOMS = ("api", "cli", "protocol", "report", "studies", "tuning")
"""Folders of surgsim that only see finished runs: they cannot change one."""


@lru_cache(maxsize=1)
def sources_sha256() -> str:
    """Hash of what can change a run: surgsim's modules, but for `LATER_ROOMS`, and its assets.

    A checkout and an installed wheel of the same sources have the same hash. Scenarios do not count: a run's
    own scenario is hashed with every default.
    """
    return hash_of_hashes(source_hashes())


def source_hashes() -> dict[str, str]:
    """The same, a hash for each file, by names that do not depend on the place of the installation."""
    modules = (path for path in ROOT.rglob("*.py") if _counts(path.relative_to(ROOT).parts))
    assets = resource_dir("assets")
    named = [*_named(modules, ROOT, "surgsim"), *_named(assets.rglob("*"), assets, "assets")]
    return {name: _hash(path) for name, path in sorted(named)}


def package_sha256(place: Path) -> str:
    """Hash of all files of another package, data files too: a folder, or one module's file."""
    if not place.is_dir():
        return hash_of([(place.name, place)])
    return hash_of(_named(place.rglob("*"), place, place.name))


def hash_of(files: Iterable[tuple[str, Path]]) -> str:
    """Hash of names and contents of files, whatever their order."""
    return hash_of_hashes({name: _hash(path) for name, path in files})


def hash_of_hashes(hashes: Mapping[str, str]) -> str:
    """One hash of files' names and hashes, whatever their order."""
    sha = hashlib.sha256()
    for name in sorted(hashes):
        sha.update(f"{name}\0{hashes[name]}\n".encode())
    return sha.hexdigest()


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _counts(parts: tuple[str, ...]) -> bool:
    return parts[0] not in (*LATER_ROOMS, "_data")


def _named(paths: Iterable[Path], root: Path, name: str) -> Iterator[tuple[str, Path]]:
    """Files with their names below `name`, without what Python compiled."""
    for path in paths:
        if path.is_file() and "__pycache__" not in path.parts:
            yield f"{name}/{path.relative_to(root).as_posix()}", path
