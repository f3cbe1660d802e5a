"""How the figures are made, and with what."""

import json
from pathlib import Path
from string import Template
from typing import Any

from surgsim.compare.figure_text import exactly, heading_of
from surgsim.compare.intervals import FEWEST, RESAMPLES
from surgsim.metrics.catalog import METRICS
from surgsim.metrics.metric import Metric
from surgsim.report import html
from surgsim.report.results import Results


def methods_section(results: Results) -> str:
    """Methods in words, and the meaning of every metric."""
    template = Template(Path(__file__).with_name("methods.html").read_text(encoding="utf-8"))
    words = template.substitute(resamples=RESAMPLES, fewest=FEWEST)
    rows = [_metric(results, METRICS[name]) for name in results.metrics]
    missing = [name for name in METRICS if name not in results.metrics]
    text = f"Not defined in any completed run: {', '.join(missing)}." if missing else ""
    head = ["metric", "meaning", "better", "smallest difference that matters"]
    metrics = html.table("Metrics", head, rows, "wide")
    return html.section(
        "methods",
        "Methods",
        html.details("How the figures are made", words, printed=True),
        html.details(
            "What the metrics mean, and which differences matter", metrics, html.paragraph(text), printed=True
        ),
    )


def _metric(results: Results, metric: Metric) -> list[str]:
    """A row of the table of metrics."""
    matters, unit = results.runs.matters(metric.name), heading_of(metric)[1]
    source = str(metric.matters_source) if matters == metric.matters else "set for this batch"
    least = f"{html.escape(exactly(matters, unit))}<small>{html.escape(source)}</small>" if matters else "any"
    name = f"<small><code>{html.breakable(metric.name)}</code></small>"
    return [
        f'<th scope="row">{html.escape(metric.heading)}{name}</th>',
        html.escape(metric.meaning),
        {True: "less", False: "more", None: "neither"}[metric.lower_is_better],
        least,
    ]


def versions_section(results: Results) -> str:
    """The command, versions, machines and scenario hashes."""
    suite = results.suite
    provenance = suite.get("provenance") or {}
    facts: list[tuple[str, Any]] = [("command", suite.get("command")), ("seeds", suite.get("seeds"))]
    facts += [("grid", json.dumps(suite["grid"]))] if suite.get("grid") else []
    facts += [("settings", json.dumps(suite["settings"]))] if suite.get("settings") else []
    for label, column in (("surgsim", "surgsim_version"), ("commit", "commit"), ("machine", "machine")):
        facts.append((label, ", ".join(sorted({str(row[column]) for row in results.rows if row[column]}))))
    facts.append(("python", provenance.get("python")))
    packages = provenance.get("packages") or {}
    facts.append(("packages", ", ".join(f"{name} {version}" for name, version in packages.items())))
    shown = "".join(
        f"<dt>{html.escape(name)}</dt><dd>{html.escape(value)}</dd>" for name, value in facts if value
    )
    mixed = len({row["code_sha256"] for row in results.rows}) > 1
    warning = html.paragraph("Runs of several versions of the code are mixed.", "warning") if mixed else ""
    return html.section("versions", "Versions", warning, f"<dl>{shown}</dl>")
