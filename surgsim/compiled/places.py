"""Folders for compiled kernels: one to write to, and those to read from.

Kernels lie beside the source, in `surgsim/__pycache__/kernels`, where the installation can be written. Else
they lie in the user's cache folder, else in a folder of the user's own among the temporary files. All are
read, so kernels that were compiled when an image was built serve every user of it. A cache folder that a
person gives to numba comes first.
"""

import os
import stat
import tempfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numba
from numba.misc.appdirs import AppDirs

_PACKAGE = Path(__file__).resolve().parents[1]


@lru_cache(maxsize=1)
def places() -> tuple[Path, ...]:
    """Folders to read kernels from, whether they exist or not, the first to write to first."""
    return tuple(_candidates())


def usable(place: Path) -> bool:
    """Whether nobody but this user, or who installed surgsim, could have put something into `place`."""
    if place in _trusted():
        return place.is_dir()
    return _is_ours(place)


def prepared(place: Path) -> bool:
    """Make the folder `place` if it can be made; whether a file can be written there."""
    try:
        private = place not in _trusted()
        place.mkdir(parents=True, exist_ok=True, mode=0o700 if private else 0o777)
        return usable(place) and os.access(place, os.W_OK | os.X_OK)
    except OSError:
        return False


def _trusted() -> tuple[Path, ...]:
    """Folders that are as much to be trusted as the source, or that a person named."""
    given = getattr(numba.config, "CACHE_DIR", "")
    beside = _PACKAGE / "__pycache__" / "kernels"
    return (Path(given).absolute() / "surgsim", beside) if given else (beside,)


def _candidates() -> Iterator[Path]:
    yield from _trusted()
    home = Path(AppDirs(appname="surgsim", appauthor=False).user_cache_dir)
    if home.is_absolute():  # of a user without a home it is relative: a folder named ~
        yield home / "kernels"
    scratch = _temporary_folder()
    if scratch is not None:
        yield scratch / f"surgsim-kernels-{os.getuid()}"


def _temporary_folder() -> Path | None:
    """Where temporary files go; None if that is only the working folder, for want of another one."""
    try:
        found = Path(tempfile.gettempdir())
    except OSError:
        return None
    named = [os.environ.get(name, "") for name in ("TMPDIR", "TEMP", "TMP")]
    usual = {os.path.abspath(path) for path in (*named, "/tmp", "/var/tmp", "/usr/tmp") if path}
    return found if str(found) in usual else None


def _is_ours(place: Path) -> bool:
    """Whether `place` is a folder, no link, of this user, that no other one can write to."""
    try:
        found = place.lstat()
    except OSError:
        return False
    if not stat.S_ISDIR(found.st_mode):
        return False
    return found.st_uid == os.geteuid() and not found.st_mode & 0o022
