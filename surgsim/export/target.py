"""Files that are exported: which suffixes there are, and that nothing is lost."""

from collections.abc import Iterable
from pathlib import Path

from surgsim.errors import SurgsimError
from surgsim.recording.files import replacing, write_file


def check_target(option: str, path: Path, suffixes: Iterable[str], *, force: bool) -> None:
    """Refuse what cannot be written, before any work is done.

    Args:
        option: The option that names the file.
        path: The file.
        suffixes: Those that there are.
        force: Whether a file that is there may be replaced.

    Raises:
        SurgsimError: If the suffix is another one, the folder is not there, or the file is.
    """
    known = sorted(suffixes)
    if path.suffix.lower() not in known:
        raise SurgsimError(f"{option} {path}: '{path.suffix}' is not known. Allowed: {', '.join(known)}.")
    if path.is_dir():
        raise SurgsimError(f"{option} {path}: is a folder")
    if not path.parent.is_dir():
        raise SurgsimError(f"{option} {path}: there is no folder {path.parent}")
    if path.exists() and not force:
        raise SurgsimError(f"{option} {path}: is there already; --force replaces it")


def write_whole(path: Path, content: bytes | str) -> None:
    """Write a file that appears whole or not at all.

    Raises:
        SurgsimError: If the file system refuses.
    """
    with replacing(path) as draft:
        write_file(draft, content)
