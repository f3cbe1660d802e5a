"""The whole page."""

from collections.abc import Mapping
from pathlib import Path

from surgsim import __version__
from surgsim.compare.summary import summary
from surgsim.report import html
from surgsim.report.axes import axes_of, sweeps_of
from surgsim.report.results import Results
from surgsim.report.sections.gain_maps import maps_section
from surgsim.report.sections.leaderboard import Boards, boards_of, failures_section, leaderboard_section
from surgsim.report.sections.methods import methods_section, versions_section
from surgsim.report.sections.pairs import pairs_section
from surgsim.report.sections.ranking import ranking_section
from surgsim.report.sections.robustness import robustness_section
from surgsim.report.sections.runs import runs_section
from surgsim.report.sections.scenario import scenario_section
from surgsim.report.series import Series

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"


def page(results: Results, series: Mapping[str, Series], file: Path) -> str:
    """The page as one string; `file` is where it will be, for its links."""
    boards = boards_of(results)
    scenarios = results.runs.scenarios
    parts = [
        leaderboard_section(results, boards),
        failures_section(results),
        robustness_section(results),
        maps_section(results),
        ranking_section(results, boards),
        pairs_section(results),
        *(scenario_section(results, name, k, series.get(name)) for k, name in enumerate(scenarios)),
        runs_section(results, file),
        methods_section(results),
        versions_section(results),
    ]
    title = html.escape(f"{_name(results)}: surgsim report")
    style, script = (
        Path(__file__).with_name(name).read_text(encoding="utf-8") for name in ("page.css", "page.js")
    )
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<meta name="generator" content="surgsim {__version__}">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
{_header(results, boards)}
{_navigation(results)}
<main>
{chr(10).join(part for part in parts if part)}
</main>
<script>{script}</script>
</body>
</html>
"""


def _name(results: Results) -> str:
    return str(results.suite.get("name") or results.folder.resolve().name)


def _header(results: Results, boards: Boards) -> str:
    runs = results.runs
    failed = len(runs) - int(runs.completed.sum())
    facts = (
        ("runs", len(runs), ""),
        ("completed", len(runs) - failed, ""),
        ("failed", failed, "bad" if failed else ""),
        ("controllers", len(runs.controllers), ""),
        ("scenarios", len(runs.scenarios), ""),
        ("grid points", len(set(runs.parameters.tolist())), ""),
        ("seeds", len(set(runs.seed.tolist())), ""),
    )
    items = "".join(f'<li class="{kind}"><b>{count}</b>{name}</li>' for name, count, kind in facts)
    about = html.paragraph(str(results.suite.get("description") or ""))
    title = f"<h1>{html.escape(_name(results))}</h1>"
    return (
        f'<header><div>{title}{about}{_result(results, boards)}<ul class="facts">{items}</ul></div></header>'
    )


def _result(results: Results, boards: Boards) -> str:
    """Who wins, by how much, how sure, and where each fails."""
    if not boards:
        return ""
    metric = results.headline[0]
    told = summary(results.runs, metric, list(boards[metric].values()))
    rows = "".join(
        f'<li class="{"bad" if one.bad else ""}">{html.escape(one.sentence)}.</li>' for one in told.failing
    )
    fails = f'<h2>Where each fails</h2><ul class="failing">{rows}</ul>'
    return html.paragraph(told.first, "lead") + html.paragraph(told.least) + fails


def _navigation(results: Results) -> str:
    targets = [("leaderboard", "Leaderboard"), ("failures", "Failures")]
    targets += [("robustness", "Robustness")] if sweeps_of(results) else []
    targets += [("frontier", "Frontier")] if len(axes_of(results)) > 1 else []
    if results.metrics:
        targets.append(("ranking", "Rank"))
        targets += [("pairs", "Pairs")] if len(results.runs.controllers) > 1 else []
    targets += [(f"scenario-{k}", name) for k, name in enumerate(results.runs.scenarios)]
    targets += [("runs", "Runs"), ("methods", "Methods"), ("versions", "Versions")]
    links = "".join(f'<li><a href="#{anchor}">{html.escape(name)}</a></li>' for anchor, name in targets)
    return f'<nav aria-label="Sections"><ul>{links}</ul></nav>'
