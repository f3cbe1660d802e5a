"""The cache of compiled kernels: one file an entry, named by what it depends on.

An entry is never changed: it is written beside its place and renamed, and an edit of the source gives another
name. A file that is cut, damaged or not readable counts as not there, and is written again.
"""

import hashlib
import multiprocessing
import os
import pickle
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core import sigutils
from numba.core.caching import _Cache
from numba.core.errors import NumbaWarning
from numba.core.serialize import dumps

from surgsim.compiled import watch
from surgsim.compiled.identity import UnknownValueError, identity
from surgsim.compiled.library import KernelLibrary, defined_by, expect, rebuilt
from surgsim.compiled.lock import CompileLock
from surgsim.compiled.places import places, prepared, usable

SUFFIX = ".nbi"
ENTRANCE = ".from_python"
"""What follows the name of a kernel in that of its entrance."""
MOST_ENTRIES = 10_000
"""Some 50 kB each. All tests together compile some 1,500."""
_MAGIC = b"surgsim kernel 3\n"
_HOUR_S = 3_600.0
_NOTED_S = 60.0
"""How far the time at which an entry was last used may lag."""


class KernelCache(_Cache):
    """What numba asks for compiled code of one kernel, and gives it to."""

    def __init__(self, dispatcher: Any, compiled: Any) -> None:
        """The cache of a dispatcher that compiles the function `compiled`, which may only call its own."""
        self._dispatcher, self._compiled = dispatcher, compiled
        function = dispatcher.py_func
        self._kernel = f"{function.__module__}.{function.__qualname__}".replace("<locals>.", "")
        self._is_entrance = compiled is not function  # part of its kernel for who is told of it
        if self._is_entrance:
            self._kernel += ENTRANCE
        self._entry_of: dict[Any, str | None] = {}
        self._locks: dict[Any, CompileLock] = {}
        self._enabled = True

    @property
    def cache_path(self) -> str | None:
        """The folder that is written to first."""
        return str(places()[0])

    def enable(self) -> None:
        """Use the cache."""
        self._enabled = True

    def disable(self) -> None:
        """Do not use the cache."""
        self._enabled = False

    def flush(self) -> None:
        """Nothing: entries that nobody uses go by themselves."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The kernel compiled for `sig`; None if it has to be compiled."""
        target_context.refresh()
        entry = self._entry(sig, target_context.codegen().magic_tuple())
        found = None if entry is None else _load(entry, target_context)
        if found is None and entry is not None:
            found = self._wait(sig, entry, target_context)
        if found is None:
            self._expect(sig, entry)
            if not self._is_entrance:
                watch.began(self._kernel)
        elif not self._is_entrance:
            watch.loaded()
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the kernel that was compiled for `sig`."""
        try:
            entry = self._entry(sig, data.codegen.magic_tuple())
            if entry is not None and self._may_be_kept(data):
                _write(entry, _content(data))
                data.library.entry = entry
                _RESULTS[entry] = data._replace(metadata=None)  # as if it had been loaded
        finally:
            lock = self._locks.pop(sig, None)
            if lock is not None:
                lock.release()
            if not self._is_entrance:
                watch.ended(self._kernel)

    def _entry(self, sig: Any, machine: Any) -> str | None:
        """Name of the file for `sig`; None if there can be none."""
        if not self._enabled:
            return None
        if sig not in self._entry_of:
            try:
                key = identity(self._dispatcher, sig, machine)
                self._entry_of[sig] = f"{self._kernel[-80:]}-{key[:40]}{SUFFIX}"
            except UnknownValueError:
                self._entry_of[sig] = None
        return self._entry_of[sig]

    def _expect(self, sig: Any, entry: str | None) -> None:
        """Give the kernel that is to be compiled the name of its entry's key."""
        key = None if entry is None else entry.removesuffix(SUFFIX).rpartition("-")[2]
        arguments, _ = sigutils.normalize_signature(sig)
        from_python = not self._dispatcher.targetoptions.get("no_cpython_wrapper", False)
        expect(self._compiled, tuple(arguments), from_python, key)

    def _wait(self, sig: Any, entry: str, target_context: Any) -> Any:
        """The kernel, if another process is compiling it; else this one is to, and the others wait."""
        place = place_to_write()
        if place is None:
            return None
        lock = CompileLock(place / entry)
        lock.acquire((place / entry).is_file, lambda: watch.awaits(self._kernel))
        found = _load(entry, target_context)
        if found is None:
            self._locks[sig] = lock
        else:
            lock.release()
        return found

    def _may_be_kept(self, data: Any) -> bool:
        if any(library.entry is None for library in data.library.needs):
            return False
        if any(not code.can_cache for code in data.lifted) or data.library.has_dynamic_globals:
            text = f"kernel {self._kernel} holds addresses or large global arrays, so it cannot be kept"
            warnings.warn(text, NumbaWarning, stacklevel=2)
            return False
        return True


_RESULTS: dict[str, Any] = {}


def _load(entry: str, target_context: Any) -> Any:
    """The compiled kernel of an entry, after those whose symbols it holds; None if one is not there."""
    if entry not in _RESULTS:
        for place in places():
            payload = _read(place / entry) if usable(place) else None
            if payload is not None:
                with suppress(Exception):  # whatever is wrong with it, it can be compiled
                    found = _result(payload, target_context)
                    if found is not None:
                        found.library.entry = entry
                        _RESULTS[entry] = found
                        break
    return _RESULTS.get(entry)


def _content(data: Any) -> bytes:
    """What is kept of a compiled kernel."""
    library: KernelLibrary = data.library
    needed = [other.entry for other in library.needs]
    return bytes(dumps((needed, library.held, library.symbols, *data._reduce())))


def _result(payload: bytes, target_context: Any) -> Any:
    """The compiled kernel of what was kept; None if a symbol that it holds is not there.

    A kernel that it calls may be gone, or have been compiled again by a process that numbers types otherwise.
    """
    entries, held, symbols, stored, *rest = pickle.loads(payload)
    needed = [_load(entry, target_context) for entry in entries]
    if any(found is None for found in needed):
        return None
    libraries = [found.library for found in needed]
    if not held <= defined_by(libraries):
        return None
    library = KernelLibrary.stored(target_context.codegen(), stored, symbols, libraries)
    return rebuilt(target_context, library, tuple(rest))


def _read(path: Path) -> bytes | None:
    """Content of an entry; None if there is none, or it is not what was written."""
    try:
        content = path.read_bytes()
        if time.time() - path.stat().st_mtime > _NOTED_S:
            with suppress(OSError):
                os.utime(path)  # it is in use: it goes last
    except OSError:
        return None
    head, payload = content[: len(_MAGIC) + 32], content[len(_MAGIC) + 32 :]
    return payload if head == _MAGIC + hashlib.sha256(payload).digest() else None


def _write(entry: str, payload: bytes) -> None:
    """Write an entry to the first place that takes it; if none does, say so once."""
    content = _MAGIC + hashlib.sha256(payload).digest() + payload
    for place in places():
        if prepared(place) and _written(place, entry, content):
            return
    _complain()


def _written(place: Path, entry: str, content: bytes) -> bool:
    draft: str | None = None
    try:
        handle, draft = tempfile.mkstemp(prefix=".", suffix=".part", dir=place)
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        if place.stat().st_mode & 0o004:
            os.chmod(draft, 0o644)
        os.replace(draft, place / entry)
    except OSError:
        if draft is not None:
            with suppress(OSError):
                os.unlink(draft)
        return False
    _evict(place)
    return True


def place_to_write() -> Path | None:
    """The folder that kernels are kept in; None if there is none."""
    return next((place for place in places() if prepared(place)), None)


def _evict(place: Path) -> None:
    """Remove what was not used for longest, and what killed processes left."""
    with suppress(OSError):
        surplus = sum(name.endswith(SUFFIX) for name in os.listdir(place)) - MOST_ENTRIES
        if surplus > 0:
            for _, path in sorted(_files(place, SUFFIX))[:surplus]:
                path.unlink(missing_ok=True)
        old = time.time() - _HOUR_S
        for used, path in (*_files(place, ".part"), *_files(place, ".lock")):
            if used < old:
                path.unlink(missing_ok=True)


def _files(place: Path, suffix: str) -> Iterator[tuple[float, Path]]:
    """When each file of a kind was used, and its path."""
    with os.scandir(place) as found:
        for item in found:
            if item.name.endswith(suffix):
                with suppress(OSError):
                    yield item.stat().st_mtime, Path(item.path)


_complained = False


def _complain() -> None:
    global _complained
    if not _complained and multiprocessing.parent_process() is None:
        tried = ", ".join(map(str, places()))
        print(
            f"surgsim: kernels are compiled at every start: none of these folders can be written: {tried}",
            file=sys.stderr,
        )
    _complained = True
