"""How figures look in a journal: a column's width, Times-like letters that are in the file, colours.

Colours are those of Okabe and Ito (2008), in the order of a batch's page; lines differ in their strokes too,
so that a print without colours can be read.
"""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import cycle, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from surgsim.recording import palette
from surgsim.recording.palette import hexadecimal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTHS_IN = {"column": 3.5, "page": 7.2}
"""Widths of a journal's column and page [inch]."""

LOGARITHMIC = 20.0
"""Ratio of the largest to the smallest of what is compared above which an axis is logarithmic."""

COLOURS = tuple(
    map(
        hexadecimal,
        (
            palette.BLUE,
            palette.VERMILION,
            palette.GREEN,
            palette.PINK,
            palette.ORANGE,
            palette.SKY,
            palette.BLACK,
            palette.GREY,
        ),
    )
)
STROKES = ("-", "--", "-.", ":")

_METADATA: dict[str, dict[str, Any]] = {  # without the time of day: equal figures are equal bytes
    ".pdf": {"CreationDate": None, "Producer": None, "Creator": None},
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
}
SUFFIXES = tuple(_METADATA)
_DOTS_PER_INCH = 600
_STYLE = {
    "font.family": "STIXGeneral",  # Times-like, and part of matplotlib: the same on every machine
    "mathtext.fontset": "stix",
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "axes.linewidth": 0.6,
    "grid.linewidth": 0.4,
    "grid.color": "0.88",
    "lines.linewidth": 1.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "pdf.fonttype": 42,  # TrueType: journals refuse Type 3
    "svg.fonttype": "path",  # letters as outlines: no font is needed
    "svg.hashsalt": "surgsim",
    "path.simplify": False,
}


@contextmanager
def journal_style() -> Iterator[None]:
    """Figures that are drawn and written meanwhile have a journal's letters and lines, whatever was set."""
    from matplotlib import rc_context, rcParamsDefault

    keys = {key: value for key, value in rcParamsDefault.items() if not key.startswith(("backend", "date."))}
    with rc_context({**keys, **_STYLE}):
        yield


def new_figure(width: str, height_in: float) -> "Figure":
    """A figure of a journal's `column` or `page`, without pyplot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTHS_IN[width], height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def figure_bytes(figure: "Figure", path: Path, dots_per_inch: int = _DOTS_PER_INCH) -> bytes:
    """The figure as the file that `path` names; the same figure gives the same bytes."""
    suffix, content = path.suffix.lower(), io.BytesIO()
    figure.savefig(content, format=suffix[1:], dpi=dots_per_inch, metadata=_METADATA[suffix])
    return content.getvalue()


def colours(count: int) -> list[str]:
    """A colour for each of `count` series; after eight they begin again."""
    return list(islice(cycle(COLOURS), count))


def strokes(count: int) -> list[str]:
    """A stroke for each of `count` series."""
    return list(islice(cycle(STROKES), count))
