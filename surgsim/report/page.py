"""The whole page."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from surgsim.report import html
from surgsim.report.results import Results
from surgsim.report.scenes import SceneView
from surgsim.report.sections.comparisons import pairs_section
from surgsim.report.sections.gain_maps import maps_section
from surgsim.report.sections.header import header
from surgsim.report.sections.leaderboard import boards_of, failures_section, leaderboard_section
from surgsim.report.sections.methods import methods_section, versions_section
from surgsim.report.sections.ranking import ranking_section
from surgsim.report.sections.robustness import robustness_section
from surgsim.report.sections.runs import runs_section
from surgsim.report.sections.scenarios import scenarios_section
from surgsim.report.series import Series


def page(results: Results, series: Mapping[str, Series], scenes: Sequence[SceneView], file: Path) -> str:
    """The page as one string.

    Args:
        results: The batch.
        series: Errors over time, by scenario.
        scenes: What it looks like.
        file: Where the page will be, for its links.
    """
    boards = boards_of(results)
    parts = [
        leaderboard_section(results, boards),
        failures_section(results),
        robustness_section(results),
        maps_section(results),
        pairs_section(results, boards),
        ranking_section(results, boards),
        scenarios_section(results, series),
        runs_section(results, file),
        methods_section(results),
        versions_section(results),
    ]
    sections = "\n".join(part for part in parts if part)
    style, script = (
        Path(__file__).with_name(name).read_text(encoding="utf-8") for name in ("page.css", "page.js")
    )
    body = f"{header(results, boards, scenes)}\n{_navigation(sections)}\n<main>\n{sections}\n</main>"
    return html.document(f"{results.name}: surgsim report", style, body, script)


def _navigation(sections: str) -> str:
    """Links to the sections, by their headings."""
    targets = re.findall(r'<section id="([^"]*)"><h2>(.*?)</h2>', sections)
    links = "".join(f'<li><a href="#{anchor}">{name}</a></li>' for anchor, name in targets)
    return f'<nav aria-label="Sections"><ul>{links}</ul></nav>'
