"""Pictures carry a stamp of what they were made from, so that a test can tell when they are old."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

from PIL import Image
from PIL.PngImagePlugin import PngInfo

_NAME = "surgsim"
_ASSETS = Path(__file__).resolve().parents[2] / "assets"
_LONG = hashlib.sha256().digest_size * 2
_REMARK = b"\x21\xfe" + bytes([_LONG])
"""How a remark of that many letters begins in a GIF; a zero ends it, and a semicolon the file."""


def digest(parts: Iterable[str]) -> str:
    """A stamp of some texts."""
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def assets() -> list[tuple[tuple[str, ...], str]]:
    """Every file below `assets`: its folders and name, and a hash of it."""
    files = sorted(path for path in _ASSETS.rglob("*") if path.is_file())
    return [
        (path.relative_to(_ASSETS).parts, hashlib.sha256(path.read_bytes()).hexdigest()) for path in files
    ]


def stamped(path: Path) -> str:
    """The stamp that a picture carries; empty without one."""
    if path.suffix == ".gif":
        remark = path.read_bytes()[-len(_REMARK) - _LONG - 2 :]
        return remark[len(_REMARK) : -2].decode() if remark.startswith(_REMARK) else ""
    with Image.open(path) as image:
        return str(image.info.get(_NAME, ""))


def save(image: Image.Image, path: Path, stamp: str) -> None:
    """Write a PNG picture with its stamp."""
    about = PngInfo()
    about.add_text(_NAME, stamp)
    image.save(path, optimize=True, pnginfo=about)
    print(path)


def save_again(path: Path, stamp: str) -> None:
    """Put a stamp into a PNG picture that has none."""
    with Image.open(path) as image:
        image.load()
        save(image, path, stamp)


def mark(path: Path, stamp: str) -> None:
    """Put a stamp into a GIF that has none."""
    path.write_bytes(path.read_bytes().removesuffix(b";") + _REMARK + stamp.encode() + b"\x00;")
    print(path)
