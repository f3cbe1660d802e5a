"""What is written into a picture of a run: its name, the time, both errors, how it ended."""

from functools import lru_cache
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from surgsim.models.drawing import Picture
from surgsim.trace.trace import Trace

_LINES_OF_A_PICTURE = 24
_SMALLEST_LETTERS = 9
_BAND = (10, 14, 18, 150)
_INK, _FAINT = (255, 255, 255, 255), (205, 212, 220, 255)
_MM = 1e3


@lru_cache(maxsize=8)
def _letters(size: int) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, of matplotlib: its digits are equally wide, so that figures stand still."""
    from matplotlib import get_data_path

    return ImageFont.truetype(str(Path(get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), size)


def figures(trace: Trace, row: int) -> str:
    """Time and errors at a row of the trace, of several arms the largest, in as many letters at every row."""
    tip, rcm = (
        _MM * float(np.fmax.reduce([one[name][row] for one in trace.each()]))
        for name in ("tip_error_m", "rcm_error_m")
    )
    return f"{trace['t_s'][row]:6.2f} s   tip {_error(tip)} mm   RCM {_error(rcm)} mm"


def _error(value: float) -> str:
    """` 1.234`; a dash where it is not defined. U+2007 is a space as wide as a digit."""
    text = f"{value:6.3f}" if np.isfinite(value) else f"{'–':>6}"
    return text.replace(" ", "\u2007")


def written(
    picture: Picture, head: str, text: str, note: str = "", *, lines: int = _LINES_OF_A_PICTURE
) -> Picture:
    """A picture with a band below: `head` above `text`; `note` is in the corner above.

    Args:
        picture: Pixels (height, width, 3), RGB.
        head: The upper line.
        text: The lower line.
        note: In the corner.
        lines: How many letters are as high as the picture.
    """
    height, width = picture.shape[:2]
    image = Image.fromarray(picture).convert("RGBA")
    band = Image.new("RGBA", image.size)
    draw = ImageDraw.Draw(band)
    letters = _fitting(max(head, text, key=len), width, height // lines)
    line = round(1.35 * letters.size)
    margin = letters.size // 2
    top = height - 2 * line - margin
    draw.rectangle((0, top - margin // 2, width, height), fill=_BAND)
    draw.text((margin, top), head, font=letters, fill=_INK)
    draw.text((margin, top + line), text, font=letters, fill=_FAINT)
    if note:
        length = round(draw.textlength(note, font=letters))
        draw.rectangle((0, 0, length + 2 * margin, line + margin), fill=_BAND)
        draw.text((margin, margin // 2), note, font=letters, fill=_FAINT)
    return np.array(Image.alpha_composite(image, band).convert("RGB"), dtype=np.uint8)


def _fitting(text: str, width: int, size: int) -> ImageFont.FreeTypeFont:
    """Letters of a size, or smaller, with which `text` fits into the width."""
    size = max(_SMALLEST_LETTERS, size)
    room = width - size
    length = _letters(size).getlength(text)
    return _letters(max(_SMALLEST_LETTERS, int(size * min(1.0, room / max(length, 1.0)))))
