"""Paths on the command line."""

import os
from pathlib import Path

from surgsim.errors import SurgsimError


def path_argument(text: str) -> Path:
    """`text` as a path that the file system can be asked about, whether or not something is there.

    Raises:
        SurgsimError: If it is no path, or one that may not be looked at.
    """
    if not text:
        raise SurgsimError("'' is not a path")
    try:
        os.stat(text)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError) as error:  # ValueError: NUL in the path
        shown = text if len(text) <= 200 else f"{text[:197]}..."
        raise SurgsimError(f"{shown}: cannot be used: {getattr(error, 'strerror', None) or error}") from error
    return Path(text)
