"""Files that appear whole or not at all, and are on the disk before they get their name.

Everything that a run or a batch leaves is written by `write_file`. A full or broken disk is so met in one
place, by a system call that says so at once.
"""

import contextlib
import fcntl
import glob
import os
import uuid
from collections.abc import Iterator
from pathlib import Path

from surgsim.errors import SurgsimError
from surgsim.recording.folders import sync_folder

_SUFFIX = ".partial"
_TRIES = 3


def write_file(path: Path, content: bytes | str) -> None:
    """Write a file, text as UTF-8; `replacing` and `whole_folder` wait until it is on the disk.

    Raises:
        OSError: If the disk refuses.
    """
    left = memoryview(content.encode() if isinstance(content, str) else content)
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
    try:
        while left:
            left = left[os.write(handle, left) :]
    finally:
        os.close(handle)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary sibling of `path` to write to; rename it to `path` on success, else remove it.

    Siblings that dead processes left are removed first.

    Raises:
        SurgsimError: If the file system refuses.
    """
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}{_SUFFIX}")
    handle = None
    try:
        _clear(path)
        handle = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
        lock(handle)
        yield temporary
        os.fsync(handle)
        os.replace(temporary, path)
        sync_folder(path.parent)
    except OSError as error:
        raise SurgsimError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        if handle is not None:
            release(handle)
            _remove(temporary)


def lock(handle: int) -> bool | None:
    """Lock an open file or folder until it is closed, or its process ends, however that happens.

    Returns:
        False if another process holds it, None if its file system has no locks.
    """
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def release(handle: int) -> None:
    """Close what was open for its lock alone: an error has nothing to tell, and must not hide another one."""
    with contextlib.suppress(OSError):
        os.close(handle)


def _clear(path: Path) -> None:
    """Remove temporary siblings of `path` that no process holds."""
    for left in path.parent.glob(f".{glob.escape(path.name)}.*{_SUFFIX}"):
        with contextlib.suppress(OSError):  # gone, or another user's
            handle = os.open(left, os.O_RDWR)
            try:
                if lock(handle):
                    left.unlink()
            finally:
                release(handle)


def _remove(path: Path) -> None:
    """Remove a file if it is there; a disk that refuses is asked again, and hides no earlier error."""
    for _ in range(_TRIES):
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
            return
