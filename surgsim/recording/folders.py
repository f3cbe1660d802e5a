"""Folders whose names and files are on the disk, and not only on their way to it."""

import errno
import os
from pathlib import Path

_CANNOT = {errno.EINVAL, errno.EBADF, errno.ENOTSUP, errno.EACCES}


def sync_tree(folder: Path) -> None:
    """Wait until all files and folders in `folder`, and itself, are on the disk.

    Raises:
        OSError: If the disk refuses.
    """
    for path, _, names in os.walk(folder):
        for name in names:
            _sync(Path(path) / name)
        sync_folder(Path(path))


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, each of them on the disk; nothing happens if it is there.

    Raises:
        OSError: If the disk refuses.
    """
    if folder.is_dir():
        return
    if folder.parent != folder:
        make_folder(folder.parent)
    folder.mkdir(exist_ok=True)
    sync_folder(folder.parent)


def sync_folder(folder: Path) -> None:
    """Wait until the names in `folder` are on the disk; a file system that cannot is passed over.

    Raises:
        OSError: If the disk refuses.
    """
    try:
        _sync(folder)
    except OSError as error:
        if error.errno not in _CANNOT:
            raise


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
