"""The passport's files: a page, and its chart for print."""

from collections.abc import Sequence
from pathlib import Path

from surgsim.errors import SurgsimError
from surgsim.export.paper_style import figure_bytes, journal_style
from surgsim.packages import lacking
from surgsim.protocol.definition import ProtocolConfig
from surgsim.protocol.passport import passport_figure
from surgsim.protocol.passport_page import passport_page
from surgsim.protocol.score import Score
from surgsim.recording.files import replacing, write_file
from surgsim.recording.folders import make_folder

_DOTS_PER_INCH = 220


def write_passport(
    folder: Path,
    score: Score,
    others: Sequence[Score],
    protocol: ProtocolConfig,
    drawn: Sequence[str] = (".pdf", ".png"),
) -> str:
    """Write `passport.html`, and the chart as `passport.pdf` and `passport.png`, into a score's folder.

    Args:
        folder: The folder.
        score: The score.
        others: Scores beside it.
        protocol: Their protocol.
        drawn: Suffixes of the files of the chart.

    Returns:
        Why there is no chart, in a line; empty if there is.

    Raises:
        SurgsimError: If the disk refuses.
    """
    left_out = lacking("the passport's chart is left out: it needs", "matplotlib")
    contents: dict[str, bytes | str] = {".html": passport_page(score, others, protocol)}
    if not left_out:
        contents.update(_charts(score, others, protocol, drawn))
    try:
        make_folder(folder)
        for suffix, content in contents.items():
            with replacing(folder / f"passport{suffix}") as draft:
                write_file(draft, content)
    except OSError as error:
        raise SurgsimError(f"cannot write {folder}: {error.strerror or error}") from error
    return left_out


def _charts(
    score: Score, others: Sequence[Score], protocol: ProtocolConfig, drawn: Sequence[str]
) -> dict[str, bytes]:
    """The chart by the suffix of its file."""
    with journal_style():
        figure = passport_figure(score, others, protocol)
        return {suffix: figure_bytes(figure, Path(f"passport{suffix}"), _DOTS_PER_INCH) for suffix in drawn}
