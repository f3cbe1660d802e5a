"""Rank over scenarios: mean ranks, normalised scores, performance profiles."""

import numpy as np

from surgsim.compare.aggregates import performance_profile, scores
from surgsim.metrics.catalog import METRICS
from surgsim.report import html
from surgsim.report.figures.curves import Curve, curve_plot
from surgsim.report.figures.intervals import interval_plot
from surgsim.report.results import Results
from surgsim.report.sections.leaderboard import Boards

_TAUS = 80


def ranking_section(results: Results, boards: Boards) -> str:
    """Three figures for each headline metric."""
    if not boards:
        return ""
    names = results.runs.controllers
    main, *rest = results.headline
    note = (
        "A score of 1 is the typical run of the setting's best controller (a setting is a scenario and a "
        "grid point); a score of 10 is ten times worse. The profile is the share of all runs that score at "
        "most τ: a controller that completed all its runs reaches the top, one that fails never does."
    )
    folded = [
        html.details(f"The same by {METRICS[metric].heading}", _of_metric(results, boards, metric))
        for metric in rest
    ]
    title = f"<h3>{html.escape(METRICS[main].heading)}</h3>"
    drawn = _of_metric(results, boards, main)
    return html.section(
        "ranking", "Rank over scenarios", html.paragraph(note), html.legend(names), title, drawn, *folded
    )


def _of_metric(results: Results, boards: Boards, metric: str) -> str:
    names = results.runs.controllers
    rows = [(name, index, boards[metric][name]) for index, name in enumerate(names)]
    ranked = sorted(rows, key=lambda row: row[2].rank.value if row[2].rank.value is not None else np.inf)
    rank = interval_plot([(name, i, row.rank) for name, i, row in ranked], "mean rank, 1 is best")
    score = interval_plot([(name, i, row.score) for name, i, row in ranked], "normalised score, 1 is best")
    return html.figures(
        html.figure(rank, "Mean rank", "over scenarios, failures last; ties share it"),
        html.figure(score, "Interquartile mean of scores", f"completed runs only{_failures(boards, metric)}"),
        html.figure(_profile(results, metric), "Performance profile", "share of all runs, 95 % bands"),
    )


def _failures(boards: Boards, metric: str) -> str:
    failed = {name: row.failed for name, row in boards[metric].items() if row.failed}
    return "; failed: " + ", ".join(f"{name} {count}" for name, count in failed.items()) if failed else ""


def _profile(results: Results, metric: str) -> str:
    runs = results.runs
    score = scores(runs, metric)
    finite = score[np.isfinite(score) & (score > 0.0)]
    low = min(float(finite.min()), 1.0) if finite.size else 1.0
    high = max(float(finite.max()), 2.0) if finite.size else 2.0
    taus = np.geomspace(low, high * 1.05, _TAUS)  # to the worst score: who completed all reaches the top
    curves = []
    for index, name in enumerate(runs.controllers):
        mine = np.asarray(runs.controller == name, dtype=bool)
        profile = performance_profile(runs.where(mine), score[mine], taus)
        band = (profile.low, profile.high) if not np.array_equal(profile.low, profile.high) else (None, None)
        curves.append(
            Curve(index=index, x=taus, middle=profile.fraction, low=band[0], high=band[1], steps=True)
        )
    return curve_plot(curves, "τ", "share of runs with score ≤ τ", log_x=True, unit_y=True)
