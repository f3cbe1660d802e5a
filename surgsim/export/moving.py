"""Moving pictures in a file: MP4 by PyAV, which brings its encoder; GIF by Pillow."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Protocol

import numpy as np
from PIL import Image

from surgsim.models.drawing import Picture
from surgsim.packages import require

SUFFIXES = (".gif", ".mp4")
_GIF_UNIT_S = Fraction(1, 100)
_GIF_COLOURS = 256
_CLOCK_HZ = 90_000
_QUALITY: Mapping[str, str] = {"crf": "20", "preset": "medium"}


class Film(Protocol):
    """What takes pictures."""

    def add(self, picture: Picture) -> None:
        """Take the next picture (height, width, 3), RGB."""


def period_of(path: Path, fps: float) -> float:
    """Time from picture to picture [s]: GIF has hundredths of a second."""
    if path.suffix.lower() == ".gif":
        return float(max(1, round(1.0 / (fps * _GIF_UNIT_S))) * _GIF_UNIT_S)
    return 1.0 / fps


def check_encoder(option: str) -> None:
    """Refuse to write MP4 where PyAV is not installed.

    Raises:
        MissingPackageError: Then, with the command that installs it.
    """
    require(f"{option} needs", "av")


@contextmanager
def film(draft: Path, suffix: str, period_s: float, size: tuple[int, int]) -> Iterator[Film]:
    """Write pictures of a size (width, height) to a file that is whole when the block ends.

    Args:
        draft: The file.
        suffix: What it is: `.mp4` or `.gif`.
        period_s: Time from picture to picture [s].
        size: Pixels; even numbers for `.mp4`.
    """
    made = _gif(draft, period_s) if suffix == ".gif" else mp4(draft, period_s, size)
    with made as taking:
        yield taking


class _Mp4:
    def __init__(self, container, stream) -> None:  # type: ignore[no-untyped-def]
        self._container, self._stream = container, stream

    def add(self, picture: Picture) -> None:
        import av

        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
        self._container.mux(self._stream.encode(frame))


@contextmanager
def mp4(
    draft: Path, period_s: float, size: tuple[int, int], quality: Mapping[str, str] = _QUALITY
) -> Iterator[Film]:
    """H.264 in MP4, 4:2:0, which browsers and slides play; `quality` are options of x264."""
    import av

    rate = Fraction(1.0 / period_s).limit_denominator(1000)
    with av.open(str(draft), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=rate, options=dict(quality))
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"
        yield _Mp4(container, stream)
        container.mux(stream.encode())


class _Gif:
    def __init__(self) -> None:
        self.pictures: list[Image.Image] = []

    def add(self, picture: Picture) -> None:
        image = Image.fromarray(picture)
        if self.pictures:
            self.pictures.append(image.quantize(palette=self.pictures[0], dither=Image.Dither.NONE))
        else:
            self.pictures.append(
                image.quantize(_GIF_COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
            )


@contextmanager
def _gif(draft: Path, period_s: float) -> Iterator[Film]:
    """GIF that begins again, in the colours of its first picture."""
    taking = _Gif()
    yield taking
    first, *others = taking.pictures
    with draft.open("wb") as file:
        first.save(
            file,
            "GIF",
            save_all=True,
            append_images=others,
            duration=round(1e3 * period_s),
            loop=0,
            optimize=True,
        )
