"""Archives of bundles: the same bytes for the same content, and a stranger's is not trusted.

An archive is a ZIP file whose members are stored, not compressed, in order of name and with one date. So it
has the same bytes on every machine, and no member is larger than the file itself. What is read is packed
again and must give the same bytes: nothing can be hidden between, before or after the members.
"""

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

from surgsim.errors import SurgsimError

MOST_BYTES = 64 * 2**20
"""Largest archive that is read."""
_DATE = (1980, 1, 1, 0, 0, 0)


def pack(files: Mapping[str, bytes]) -> bytes:
    """The archive of files by name."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(files):
            member = zipfile.ZipInfo(name, _DATE)
            member.create_system, member.external_attr = 3, 0o644 << 16
            archive.writestr(member, files[name])
    return out.getvalue()


def unpack(path: Path, names: frozenset[str]) -> dict[str, bytes]:
    """Files of an archive by name, in memory; nothing is written.

    Args:
        path: The archive.
        names: The names that it has to have, and no others.

    Raises:
        SurgsimError: If it cannot be read, is too large, or is not as `pack` makes it.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise SurgsimError(f"{path}: cannot be read: {error.strerror or error}") from error
    if len(content) > MOST_BYTES:
        raise SurgsimError(f"{path}: no bundle: it is larger than {MOST_BYTES // 2**20} MiB")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            files = {member.filename: _read(archive, member, names) for member in archive.infolist()}
    except (zipfile.BadZipFile, ValueError, NotImplementedError, EOFError) as error:
        raise SurgsimError(f"{path}: no bundle: {error}") from error
    if missing := sorted(names - files.keys()):
        raise SurgsimError(f"{path}: no bundle: it lacks {missing[0]}")
    if pack(files) != content:
        raise SurgsimError(
            f"{path}: no bundle: it holds something beside its files, or was not packed by surgsim"
        )
    return files


def _read(archive: zipfile.ZipFile, member: zipfile.ZipInfo, names: frozenset[str]) -> bytes:
    if member.filename not in names:
        raise ValueError(f"'{member.filename[:60]}' is no file of a bundle")
    if member.compress_type != zipfile.ZIP_STORED or member.flag_bits & 1:
        raise ValueError(f"{member.filename} is compressed or encrypted")
    if member.file_size > MOST_BYTES:
        raise ValueError(f"{member.filename} says that it has {member.file_size} bytes")
    return archive.read(member)
