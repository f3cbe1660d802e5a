"""Writes the tables of the documents that come from kept figures, between their marks in the pages.

A table stands in a page between `<!-- table NAME -->` and `<!-- end -->`. `tests/test_made.py` holds pages
against the results.
"""

import json
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import compared
import numpy as np
from ruamel.yaml import YAML

from surgsim.compare.observations import Observations
from surgsim.compare.table import read_table
from surgsim.protocol.figures import share
from surgsim.report.axes import sweeps_of
from surgsim.report.failing import along, at_level
from surgsim.report.results import read_results

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "results" / "leaderboard"
PAGES = (
    "docs/results.md",
    "docs/protocol.md",
    "docs/robustness.md",
    "docs/drives.md",
    "docs/baselines.md",
    "docs/statistics.md",
    "docs/peg_and_ring.md",
    "results/leaderboard/README.md",
)
_MARKED = r"(<!-- table (\w+) -->\n\n).*?(\n<!-- end -->)"
_ARMS = {"lwr4plus": "LWR4+", "panda": "Panda"}

Rows = Sequence[Mapping[str, Any]]
Statistic = Callable[[Sequence[float]], float]


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of figures.

    Attributes:
        heading: What the page calls it.
        metric: The metric.
        of: What is taken of the runs' values.
    """

    heading: str
    metric: str
    of: Statistic = np.mean


def rows_of(suite: str, scenario: str = "") -> Rows:
    """Runs of a suite, of one scenario if named."""
    rows = read_table(RESULTS / suite).rows()
    return [row for row in rows if scenario in ("", row["scenario"])]


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    cells = [head, ["---"] * len(head), *lines]
    return (
        "".join("| " + " | ".join(line) + " |\n" for line in cells)
        .replace("| --- ", "|---")
        .replace("|--- |", "|---|")
    )


def figure(rows: Rows, column: Column) -> str:
    """A cell: the figure over completed runs, with a note of those that failed."""
    done = [row for row in rows if row["outcome"] == "completed"]
    if not done:
        return f"{len(rows)} of {len(rows)} failed"
    lost = f" ({len(rows) - len(done)} of {len(rows)} failed)" if len(done) < len(rows) else ""
    return f"{float(column.of([row[column.metric] for row in done])):.3g}{lost}"


def by_controller(suite: str, columns: Mapping[str, Sequence[Column]], key: tuple[str, str]) -> str:
    """A row for each controller, best first by metric `key[1]` of scenario `key[0]`; columns by scenario."""
    names = dict.fromkeys(row["controller"] for row in rows_of(suite))
    rows = {
        (scenario, name): [row for row in rows_of(suite, scenario) if row["controller"] == name]
        for scenario in columns
        for name in names
    }
    order = sorted(
        names, key=lambda name: (float(np.mean([row[key[1]] for row in rows[key[0], name]])), name)
    )
    head = ["controller", *(column.heading for group in columns.values() for column in group)]
    lines = [
        [f"`{name}`"]
        + [figure(rows[scenario, name], column) for scenario, group in columns.items() for column in group]
        for name in order
    ]
    return table(head, lines)


def by_scenario(suite: str, controller: str, columns: Sequence[Column]) -> str:
    """A row for each scenario, of one controller."""
    mine = [row for row in rows_of(suite) if row["controller"] == controller]
    names = dict.fromkeys(row["scenario"] for row in mine)
    lines = [
        [f"`{name}`", *(figure([row for row in mine if row["scenario"] == name], c) for c in columns)]
        for name in names
    ]
    return table(["scenario", *(column.heading for column in columns)], lines)


def _theatre(arm: str) -> str:
    scenario = f"theatre_ideal_{arm}"
    columns = [
        Column(heading="tip RMS, mean", metric="tip_error_rms_mm"),
        Column(heading="tip RMS, worst", metric="tip_error_rms_mm", of=np.max),
        Column(heading="RCM RMS, mean", metric="rcm_error_rms_mm"),
        Column(heading="RCM RMS, worst", metric="rcm_error_rms_mm", of=np.max),
        Column(heading="RCM max, worst", metric="rcm_error_max_mm", of=np.max),
        Column(heading="wall force RMS, mean [N]", metric="trocar_force_rms_n"),
    ]
    return by_controller("theatre_ideal", {scenario: columns}, (scenario, "rcm_error_rms_mm"))


def _theatre_short() -> str:
    """A row for each controller over all arms of the theatre; best first, those that always fail last."""
    columns = [
        Column(heading="tip RMS, mean", metric="tip_error_rms_mm"),
        Column(heading="tip RMS, worst", metric="tip_error_rms_mm", of=np.max),
        Column(heading="RCM RMS, mean", metric="rcm_error_rms_mm"),
        Column(heading="RCM RMS, worst", metric="rcm_error_rms_mm", of=np.max),
        Column(heading="RCM max, worst", metric="rcm_error_max_mm", of=np.max),
    ]
    return _over_arms(columns)


def _over_arms(columns: Sequence[Column]) -> str:
    head = ["controller", "completed", "did the task", *(column.heading for column in columns)]
    lines = [
        [f"`{name}`", f"{len(done)} of {count}", str(sum(row["success"] for row in done))]
        + [f"{float(c.of([row[c.metric] for row in done])):.3g}" if done else "–" for c in columns]
        for name, count, done in _theatre_order()
    ]
    return table(head, lines)


def _theatre_order() -> list[tuple[str, int, Rows]]:
    """Controllers of the theatre, number of runs, those that completed; best first, failed last."""
    rows = rows_of("theatre")
    names = dict.fromkeys(row["controller"] for row in rows)
    mine = {name: [row for row in rows if row["controller"] == name] for name in names}
    done = {name: [row for row in runs if row["outcome"] == "completed"] for name, runs in mine.items()}

    def order(name: str) -> tuple[float, str]:
        error = np.mean([row["rcm_error_rms_mm"] for row in done[name]]) if done[name] else np.inf
        return float(error), name

    return [(name, len(mine[name]), done[name]) for name in sorted(names, key=order)]


def theatre_errors() -> list[tuple[str, str, dict[str, list[float]]]]:
    """Of each controller of the theatre, best first: name, how its runs ended, RCM RMS by arm [mm]."""
    arms = {"FR3": "fr3", "Panda": "panda", "iiwa14": "iiwa14", "LWR4+": "lwr4plus"}
    return [
        (
            name,
            f"{len(done)} of {count} completed,\n{sum(row['success'] for row in done)} did the task",
            {
                title: [row["rcm_error_rms_mm"] for row in done if row["scenario"] == f"theatre_{arm}"]
                for title, arm in arms.items()
            },
        )
        for name, count, done in _theatre_order()
    ]


def _drives_arms() -> str:
    """Ours and its rival of equal means, arm by arm."""
    arms = {"fr3": "FR3", "panda": "Panda", "iiwa14": "iiwa14", "lwr4plus": "LWR4+"}
    controllers = ("rcm_elastic_dynamics", "joint_elastic_dynamics", "joint_impedance_tuned")
    lines = []
    for arm, title in arms.items():
        for name in controllers:
            rows = [row for row in rows_of("theatre", f"theatre_{arm}") if row["controller"] == name]
            done = [row for row in rows if row["outcome"] == "completed"]
            worst = {
                key: max(row[key] for row in done)
                for key in ("tip_error_rms_mm", "rcm_error_rms_mm", "torque_rate_over_fraction")
            }
            cells = [f"{value:.3g}" for value in worst.values()]
            lines.append([title, f"`{name}`", f"{len(done)} of {len(rows)}", *cells])
    head = [
        "arm",
        "controller",
        "completed",
        "tip RMS, worst",
        "RCM RMS, worst",
        "ticks at the torque's rate",
    ]
    return table(head, lines)


def _drives_levels() -> str:
    """For each sweep and arm the mean RCM RMS of ours at every level."""
    rows = [row for row in rows_of("drives") if row["controller"] == "rcm_elastic_dynamics"]
    suite = YAML(typ="safe").load(ROOT / "scenarios" / "suites" / "drives.yaml")
    lines = []
    for name, sweep in suite["sweeps"].items():
        for scenario, title in (("theatre_fr3", "FR3"), ("theatre_lwr4plus", "LWR4+")):
            mine = [row for row in rows if name in levels(row) and row["scenario"] == scenario]
            lines.append([sweep["label"], title, *_cells(mine, name, sweep["levels"])])
    return table(["what", "arm", "RCM RMS / tip RMS at each level"], lines)


def levels(row: Mapping[str, Any]) -> dict[str, float]:
    """The levels of a run, by the name of the sweep."""
    found: dict[str, float] = json.loads(row["parameters"])
    return found


def _cells(rows: Rows, name: str, at: Sequence[float]) -> list[str]:
    said = []
    for level in at:
        here = [row for row in rows if np.isclose(levels(row)[name], level)]
        done = [row for row in here if row["outcome"] == "completed"]
        lost = len(here) - len(done)
        means = (
            [np.mean([row[key] for row in done]) for key in ("rcm_error_rms_mm", "tip_error_rms_mm")]
            if done
            else []
        )
        told = f"{means[0]:.2g} / {means[1]:.2g}" if done else "–"
        said.append(f"**{level:g}**: {told}" + (f" ({lost} of {len(here)} failed)" if lost else ""))
    return ["; ".join(said)]


def _robustness() -> str:
    """For each disturbance the median RCM RMS at its lowest and highest level, and the first that fails."""
    results = read_results(RESULTS / "robustness")
    sweeps, controllers = sweeps_of(results), ("vprnn", "joint_impedance", "rcm_inverse_dynamics")
    lines = []
    for sweep in sweeps:
        found = [along(results.runs.of_controller(name), sweep, sweeps)[1:] for name in controllers]
        ends = f"{sweep.levels[0]:g} … {sweep.levels[-1]:g}"
        lines.append([f"{sweep.label}: {ends}", *(_borne(at, sweep.levels) for at in found)])
    return table(["disturbance", *(f"`{name}`" for name in controllers)], lines)


def _borne(at: Sequence[Observations], levels: Sequence[float]) -> str:
    """Median RCM RMS at the ends of a sweep (a dash: no run completed), and the first level that fails."""
    errors = [runs.values("rcm_error_rms_mm") for runs in (at[0], at[-1])]
    ends = [f"{np.nanmedian(each):.3g}" if np.isfinite(each).any() else "–" for each in errors]
    told = zip(levels, map(at_level, at), strict=True)
    fails = next((f"**{level:g}**: {here.sentence}" for level, here in told if here.mark), "holds")
    return f"{ends[0]} … {ends[1]}; {fails}"


def _baselines() -> str:
    """A row for each controller over all arms: fewest failures first, then the smallest 95th percentile."""
    columns = [
        Column(heading="RCM RMS, median", metric="rcm_error_rms_mm", of=np.median),
        Column(heading="95 %", metric="rcm_error_rms_mm", of=_most),
        Column(heading="worst", metric="rcm_error_rms_mm", of=np.max),
        Column(heading="tip RMS, median", metric="tip_error_rms_mm", of=np.median),
        Column(heading="95 %", metric="tip_error_rms_mm", of=_most),
        Column(heading="torque, mean [N m]", metric="torque_total_mean_nm"),
        Column(heading="ticks at the rate, 95 %", metric="torque_rate_over_fraction", of=_most),
    ]
    rows = [row for row in rows_of("baselines") if row["outcome"] != "refused"]
    names = dict.fromkeys(row["controller"] for row in rows)
    mine = {name: [row for row in rows if row["controller"] == name] for name in names}
    done = {name: [row for row in of if row["outcome"] == "completed"] for name, of in mine.items()}

    def order(name: str) -> tuple[int, float]:
        errors = [row["rcm_error_rms_mm"] for row in done[name]]
        return len(mine[name]) - len(done[name]), _most(errors) if errors else np.inf

    def cell(column: Column, of: Rows) -> str:
        values = [row[column.metric] for row in of if row[column.metric] is not None]
        return f"{float(column.of(values)):.3g}" if values else "–"

    lines = [
        [f"`{name}`", f"{len(done[name])} of {len(mine[name])}", *(cell(c, done[name]) for c in columns)]
        for name in sorted(names, key=order)
    ]
    return table(["controller", "completed", *(column.heading for column in columns)], lines)


def _most(values: Sequence[float]) -> float:
    """The 95th percentile."""
    return float(np.quantile(values, 0.95))


def _breathing(kind: str, metrics: tuple[tuple[str, str], tuple[str, str]]) -> str:
    columns = {
        f"breathing_{kind}_{arm}": [
            Column(heading=f"{name}: {metrics[0][0]}", metric=metrics[0][1]),
            Column(heading=metrics[1][0], metric=metrics[1][1]),
        ]
        for arm, name in _ARMS.items()
    }
    return by_controller(f"breathing_{kind}", columns, (next(iter(columns)), metrics[0][1]))


def _nominal() -> str:
    columns = [
        Column(heading="tip RMS", metric="tip_error_rms_mm"),
        Column(heading="tip max", metric="tip_error_max_mm"),
        Column(heading="RCM RMS", metric="rcm_error_rms_mm"),
        Column(heading="RCM max", metric="rcm_error_max_mm"),
    ]
    return by_scenario("nominal", "vprnn", columns)


def peg_and_ring() -> list[tuple[float, Rows]]:
    """Runs of the suite `peg_and_ring` by the delay of the channel, one way [ms]."""
    rows = rows_of("peg_and_ring")
    return [
        (level, [row for row in rows if levels(row)["delay"] == level])
        for level in sorted({levels(row)["delay"] for row in rows})
    ]


def _peg_and_ring() -> str:
    """A row for each delay: success with its interval, then means over all runs."""
    columns = {
        "rings of 3": "rings_transferred",
        "time [s]": "run_time_s",
        "grasps missed": "grasps_missed",
        "drops": "ring_drops",
        "way of the tip [m]": "tip_path_length_m",
        "economy": "economy_of_motion",
        "`sparc`": "sparc",
        "force on the jaws, largest [N]": "peg_contact_force_max_n",
        "on the shaft": "shaft_contact_force_max_n",
    }
    lines = []
    for level, rows in peg_and_ring():
        done = share([row["transfer_success"] == 1.0 for row in rows])
        hits = sum(row["transfer_success"] == 1.0 for row in rows)
        told = f"{hits} of {len(rows)} ({done.low:.2f} to {done.high:.2f})"
        values = {
            metric: [row[metric] for row in rows if row[metric] is not None] for metric in columns.values()
        }
        lines.append([f"{level:g} ms", told, *(f"{np.mean(v):.3g}" if v else "–" for v in values.values())])
    return table(["delay, one way", "success", *columns], lines)


RCM = (("RCM RMS", "rcm_error_rms_mm"), ("RCM max", "rcm_error_max_mm"))
FORCE = (("force RMS [N]", "trocar_force_rms_n"), ("max [N]", "trocar_force_max_n"))
VERDICTS = ("holds", "depends", "does not hold", "not comparable")


def _protocol() -> str:
    """What the protocol's leaderboard says of each track."""
    page = (ROOT / "results" / "surgsim_v1" / "README.md").read_text(encoding="utf-8")
    found = re.findall(r"^## Track (\w+)\n\n(.+)$", page, re.M)
    return table(["track", "who comes furthest"], [[f"`{track}`", told] for track, told in found])


def _studies() -> str:
    """How many claims of each study hold, counted in its page; the papers' and ours."""
    lines = []
    for page in sorted((ROOT / "results").glob("*/README.md")):
        claims = re.findall(
            r"^\| .+ \| (.+?) \| \*\*([a-z ]+)\*\* \| .* \|$", page.read_text(encoding="utf-8"), re.M
        )
        for kind in ("the paper's", "ours") if claims else ():
            mine = [verdict for by, verdict in claims if (by == "surgsim") == (kind == "ours")]
            counts = [str(mine.count(verdict)) for verdict in VERDICTS]
            lines.append([f"[{page.parent.name}](../results/{page.parent.name}/README.md)", kind, *counts])
    return table(["study", "claims", *VERDICTS], lines)


TABLES: dict[str, Callable[[], str]] = {
    "margins": lambda: table(*compared.margins()),
    "coverage": lambda: table(*compared.coverage()),
    "coverage_of_rates": lambda: table(*compared.coverage_of_rates()),
    "nominal": _nominal,
    "studies": _studies,
    "protocol": _protocol,
    "theatre_short": _theatre_short,
    "baselines": _baselines,
    "peg_and_ring": _peg_and_ring,
    "robustness": _robustness,
    "drives_arms": _drives_arms,
    "drives_levels": _drives_levels,
    "theatre_ideal_lwr4plus": lambda: _theatre("lwr4plus"),
    "theatre_ideal_panda": lambda: _theatre("panda"),
    "breathing_tracked": lambda: _breathing("tracked", RCM),
    "breathing_hidden": lambda: _breathing("hidden", FORCE),
}
"""Every table that a page may hold."""


def filled(text: str) -> str:
    """`text` of a page with its tables made from the results."""
    return re.sub(_MARKED, lambda match: match[1] + TABLES[match[2]]() + match[3], text, flags=re.S)


def main() -> int:
    """Write the tables into their pages."""
    for name in PAGES:
        page = ROOT / name
        text = page.read_text(encoding="utf-8")
        if (made := filled(text)) != text:
            page.write_text(made, encoding="utf-8")
            print(page)
    return 0


if __name__ == "__main__":
    sys.exit(main())
