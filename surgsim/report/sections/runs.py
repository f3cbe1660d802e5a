"""Every run, with links to its folder and recording."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from surgsim.compare.failures import outcome_words
from surgsim.compare.figure_text import number
from surgsim.compare.observations import COMPLETED
from surgsim.metrics.catalog import METRICS
from surgsim.report import html
from surgsim.report.results import Results, parameters_of

MOST_ROWS = 5000


def runs_section(results: Results, page: Path) -> str:
    """The list of runs, folded."""
    shown = results.rows[:MOST_ROWS]
    metrics = results.headline[:2]
    head = [
        "run",
        "recording",
        "folder",
        "outcome",
        "seed",
        "grid point",
        *(html.escape(METRICS[name].heading) for name in metrics),
    ]
    rows = [_row(results, row, metrics, page) for row in shown]
    note = html.paragraph(
        "Open a recording with `surgsim inspect FOLDER --view`. The links are relative: move the page only "
        "together with its folder."
    )
    more = len(results.rows) - len(shown)
    rest = html.paragraph(f"{more} more are in runs.csv.") if more else ""
    printed = '<p class="printed">Not printed; all runs are in runs.csv.</p>'
    listed = html.details(f"All {len(results.rows)} runs", html.table("Runs", head, rows, "runs"), rest)
    return html.section("runs", "Runs", note, listed, printed)


def _row(results: Results, row: Mapping[str, Any], metrics: list[str], page: Path) -> list[str]:
    point = ", ".join(f"{key} = {value}" for key, value in parameters_of(row["parameters"]).items())
    ended = html.escape(outcome_words(row["outcome"]))
    if row["outcome"] != COMPLETED:
        at = f"{number(row['outcome_t_s'])} s" if row["outcome_t_s"] is not None else ""
        detail = f"{at} {row['outcome_detail'] or ''}".strip()
        ended = f'<td class="bad">{ended}<small>{html.escape(detail)}</small></td>'
    elif row.get("success") is not None and not row["success"]:
        ended = '<td class="bad">completed<small>task not done</small></td>'
    folder, recording = row["folder"], row["recording"]
    return [
        f"{html.escape(row['scenario'])}<small>{html.escape(row['controller'])}</small>",
        html.link(results.folder, page, recording, "recording") if recording else "–",
        html.link(results.folder, page, folder, "folder") if folder else "–",
        ended,
        html.escape(row["seed"]),
        html.escape(point),
        *(number(row[name]) for name in metrics),
    ]
