"""Drafts: hidden siblings of a folder in which it is made, before it takes the folder's place.

A draft is locked by the process that writes it. The lock ends with the process, however it ends, so that a
draft which nobody locks is left over from a dead one. This holds across containers and reused process ids.
"""

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex

from surgsim.recording.files import lock, release

_SUFFIX = ".part"
_TRIES = 3


@contextmanager
def draft_of(folder: Path) -> Iterator[Path]:
    """A new draft of `folder`, locked; what has its name after the block is removed.

    Drafts that dead processes left of the same folder are removed first.

    Raises:
        OSError: If the disk refuses.
    """
    clear_drafts(folder.parent, folder.name)
    draft, handle = _another(folder), None
    try:
        # A signal may come at any line: what is to be removed is known before it is there.
        while (handle := _made(draft)) is None:
            draft = _another(folder)
        draft.chmod(0o755)
        yield draft
    finally:
        if handle is not None:
            release(handle)
        remove_tree(draft)


def clear_drafts(parent: Path, name: str = "") -> None:
    """Remove the drafts that dead processes left in `parent`: of the folder `name`, or of all.

    Raises:
        OSError: If the disk refuses.
    """
    for draft in hidden(parent, name, _SUFFIX):
        _remove_if_left(draft)


def hidden(parent: Path, name: str, suffix: str) -> list[Path]:
    """Names in `parent` like `.name.something` and `suffix`, of any `name` if it is empty.

    Something holds no dot: `.v1.1.x.part` belongs to `v1.1`, and not to `v1`. A folder that may be written to
    but not listed shows none.

    Raises:
        OSError: If the disk refuses.
    """
    form = re.compile(rf"\.{re.escape(name) if name else '.+'}\.[^.]+{re.escape(suffix)}", re.DOTALL)
    try:
        names = os.listdir(parent)
    except PermissionError:
        return []
    return [parent / found for found in names if form.fullmatch(found)]


def remove_tree(folder: Path) -> None:
    """Remove a folder if it is there; a disk that refuses is asked again, and hides no earlier error."""
    for _ in range(_TRIES):
        with suppress(OSError):  # of closing a folder, which `ignore_errors` does not cover
            shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            return


def _another(folder: Path) -> Path:
    """A name that no draft of `folder` has."""
    return folder.parent / f".{folder.name}.{token_hex(4)}{_SUFFIX}"


def _made(draft: Path) -> int | None:
    """Make a draft; the handle that locks it, or None if another process took it for left over."""
    draft.mkdir(mode=0o700)
    try:
        handle = os.open(draft, os.O_RDONLY)
    except FileNotFoundError:
        return None
    if lock(handle) is not False and draft.exists():
        return handle
    release(handle)
    return None


def _remove_if_left(draft: Path) -> None:
    try:
        handle = os.open(draft, os.O_RDONLY)
    except OSError:  # gone, or another user's
        return
    try:
        if lock(handle):
            remove_tree(draft)
    finally:
        release(handle)
