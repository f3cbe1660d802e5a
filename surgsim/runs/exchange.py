"""A folder takes the place of another one in one step.

On Linux the two names are swapped (`renameat2` with `RENAME_EXCHANGE`): whoever looks finds the old folder or
the new one, at every moment, and any number of writers may do it at once. Where the system or the file system
cannot swap, writers take turns by a lock, and a reader may miss the folder between two renames.
"""

import ctypes
import errno
import fcntl
import os
import sys
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path

from surgsim.recording.files import release
from surgsim.recording.folders import sync_folder
from surgsim.runs.drafts import hidden, remove_tree

_HERE = -100  # AT_FDCWD
_EXCHANGE = 2  # RENAME_EXCHANGE
_TAKEN = {errno.ENOTEMPTY, errno.EEXIST}
_CANNOT = {errno.ENOSYS, errno.EINVAL, errno.ENOTSUP, errno.EPERM}
_ASIDE = ".old"


def put_in_place(draft: Path, place: Path) -> None:
    """Give the folder `draft` the name `place`; a folder that had it gets the draft's name, or is removed.

    Raises:
        OSError: If the disk refuses: `place` is then as it was.
    """
    while not (_renamed(draft, place) or _swapped(draft, place)):
        pass
    sync_folder(place.parent)


def restore(place: Path) -> None:
    """Bring back what a writer that was killed between two renames had set aside, or remove it.

    Raises:
        OSError: If the disk refuses.
    """
    if not hidden(place.parent, place.name, _ASIDE):
        return
    with _turn(place):
        for aside in hidden(place.parent, place.name, _ASIDE):
            if not _renamed(aside, place):
                remove_tree(aside)


def restore_all(parent: Path) -> None:
    """`restore` every folder in `parent` that was set aside.

    Raises:
        OSError: If the disk refuses.
    """
    for aside in hidden(parent, "", _ASIDE):
        name = aside.name.removeprefix(".").removesuffix(_ASIDE).rpartition(".")[0]
        restore(parent / name)


def _renamed(draft: Path, place: Path) -> bool:
    """Whether `place` was free, or empty, and is taken now."""
    try:
        os.rename(draft, place)
    except OSError as error:
        if error.errno not in _TAKEN:
            raise
        return False
    return True


def _swapped(draft: Path, place: Path) -> bool:
    """Whether the two are swapped; not if another process takes `place` away meanwhile."""
    try:
        if not swap(draft, place):
            _in_turn(draft, place)
    except FileNotFoundError:
        return False
    return True


def swap(a: Path, b: Path) -> bool:
    """Swap the names of two folders in one step; False if the system or the file system cannot.

    Raises:
        OSError: If the disk refuses.
    """
    call = _renameat2()
    if call is None:
        return False
    if call(_HERE, os.fsencode(a), _HERE, os.fsencode(b), _EXCHANGE) == 0:
        return True
    number = ctypes.get_errno()
    if number in _CANNOT:
        return False
    raise OSError(number, os.strerror(number), str(b))


@lru_cache(maxsize=1)
def _renameat2() -> Callable[..., int] | None:
    """The C library's function, None where there is none."""
    if sys.platform != "linux":
        return None
    call = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if call is not None:
        call.argtypes = (ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_uint)
    return call


def _in_turn(draft: Path, place: Path) -> None:
    """Set aside what is at `place`, rename, and remove what was set aside; one writer at a time."""
    aside: Path | None = None
    with _turn(place):
        try:
            while not _renamed(draft, place):
                aside = place.with_name(f".{place.name}.{uuid.uuid4().hex}{_ASIDE}")
                with suppress(FileNotFoundError):
                    os.rename(place, aside)
        except OSError:
            if aside is not None and aside.exists():
                _renamed(aside, place)
            raise
        for left in hidden(place.parent, place.name, _ASIDE):
            remove_tree(left)


@contextmanager
def _turn(place: Path) -> Iterator[None]:
    """Wait for a lock beside `place`, and hold it; its file is there only as long."""
    file = place.with_name(f".{place.name}.lock")
    while True:
        handle = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX)
            if os.path.samestat(os.fstat(handle), os.stat(file)):
                break
        except FileNotFoundError:  # its last holder removed it
            pass
        except BaseException:
            release(handle)
            raise
        release(handle)
    try:
        yield
    finally:
        with suppress(OSError):
            os.unlink(file)
        release(handle)
