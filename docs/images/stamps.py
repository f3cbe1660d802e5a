"""Pictures carry a stamp of what they were made from, so that a test can tell when they are old."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

from PIL import Image
from PIL.PngImagePlugin import PngInfo

_NAME = "surgsim"


def digest(parts: Iterable[str]) -> str:
    """A stamp of some texts."""
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def stamped(path: Path) -> str:
    """The stamp that a picture carries; empty without one."""
    with Image.open(path) as image:
        return str(image.info.get(_NAME, ""))


def save(image: Image.Image, path: Path, stamp: str) -> None:
    """Write a PNG picture with its stamp."""
    about = PngInfo()
    about.add_text(_NAME, stamp)
    image.save(path, optimize=True, pnginfo=about)
    print(path)
