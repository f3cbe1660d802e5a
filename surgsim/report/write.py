"""Writing the report."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path

from surgsim.recording.files import replacing, write_file
from surgsim.report.page import page
from surgsim.report.results import Results, read_results
from surgsim.report.scenes import scenes_of
from surgsim.report.series import read_series

NAME = "report.html"


def _silent(_: str) -> None:
    """Say nothing."""


def write_report(
    folder: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    say: Callable[[str], None] = _silent,
    matters: Mapping[str, float] | None = None,
) -> Path:
    """Write the report of the batch in `folder`, whole or not at all.

    Args:
        folder: Results folder of `surgsim compare`.
        out: File to write; `report.html` in the folder if None.
        say: Told what takes long.
        matters: Smallest differences that matter, by metric, instead of the suite's.

    Returns:
        The file.

    Raises:
        SurgsimError: If there are no results, they are damaged, or the disk refuses.
    """
    return write_page(read_results(Path(folder), matters), out, say)


def write_page(
    results: Results, out: str | os.PathLike[str] | None = None, say: Callable[[str], None] = _silent
) -> Path:
    """As `write_report`, where the results have been read.

    Raises:
        SurgsimError: If the disk refuses.
    """
    file = results.folder / NAME if out is None else Path(out)
    series = read_series(results.folder, results.rows, results.runs.scenarios, say)
    text = page(results, series, scenes_of(results), file)
    with replacing(file) as draft:
        write_file(draft, text)
    return file
