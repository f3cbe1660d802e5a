"""Where a recording is, and whether its file is whole, seen from the outside: no rerun needed."""

import os
import stat
import struct
from importlib.metadata import version
from pathlib import Path
from typing import BinaryIO

from surgsim.errors import RecordingError
from surgsim.recording.contents import check_contents
from surgsim.recording.layout import FILE_NAME

_MAGIC = b"RRF2"
_ENCODINGS = (b"\x00\x02\x00\x00", b"\x01\x02\x00\x00")  # protobuf, uncompressed or LZ4
_FOOTER_MAGIC = b"RRF2FOOT"
_FILE_HEADER_BYTES = 12
_FOOTER_BYTES = 32
_MESSAGE_HEADER = struct.Struct("<QQ")  # kind, size of what follows
_END = 0


def recording_file(path: Path) -> Path:
    """`path` itself, or the recording in a run's folder, all of whose files must be as they were written.

    Raises:
        RecordingError: If there is no such file, or the run is damaged.
    """
    if path.is_dir():
        check_contents(path)
    file = path / FILE_NAME if path.is_dir() else path
    try:
        status = file.stat()
    except (OSError, ValueError) as error:  # ValueError: NUL in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise RecordingError(f"{file}: cannot be read: {reason}") from error
    if not stat.S_ISREG(status.st_mode):  # a pipe or device could block or never end
        raise RecordingError(f"{file}: is not a file")
    return file


def check_framing(file: Path) -> None:
    """Walk over the messages of a rerun file, from its header to its footer.

    A file is `RRF2`, version, encoding; messages of kind and size (unsigned 64 bit, little endian) and body;
    last a message of kind 0 and a footer of 32 bytes around `RRF2FOOT`. A file cut short fails here, and so
    does a size that would make a reader allocate without bound.

    Raises:
        RecordingError: If it is not such a file.
    """
    try:
        with file.open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            reason = _fault(stream, size)
    except OSError as error:
        raise RecordingError(f"{file}: cannot be read: {error.strerror or error}") from error
    if reason:
        raise RecordingError(f"{file}: {reason}")


def _installed_release() -> tuple[int, ...]:
    """Major and minor version of the rerun in this environment."""
    return tuple(int(part) for part in version("rerun-sdk").split(".")[:2])


def _fault(stream: BinaryIO, size: int) -> str:
    """What is wrong with the file, or nothing."""
    if size == 0:
        return "is empty"
    if stream.read(len(_MAGIC)) != _MAGIC:
        return "is not a rerun recording"
    release = tuple(stream.read(4)[:2])
    if release > _installed_release():
        return f"written by rerun {'.'.join(map(str, release))}, newer than the one installed"
    if stream.read(4) not in _ENCODINGS:
        return "damaged recording: its header is not rerun's"
    at = _FILE_HEADER_BYTES
    while at + _MESSAGE_HEADER.size <= size:
        stream.seek(at)
        kind, length = _MESSAGE_HEADER.unpack(stream.read(_MESSAGE_HEADER.size))
        at += _MESSAGE_HEADER.size + length
        if kind == _END:
            footer = stream.read(length + _FOOTER_BYTES)[length:] if at + _FOOTER_BYTES == size else b""
            return "" if _FOOTER_MAGIC in footer else "damaged recording: its end is not whole"
    return f"damaged recording: cut short or corrupt after {min(at, size)} of {size} bytes"
