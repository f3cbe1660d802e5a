"""What a tuning leaves: a controller's file, all of it as JSON, and the runs to go on with."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from surgsim.display import count, number
from surgsim.errors import SurgsimError
from surgsim.recording.files import replacing, write_file
from surgsim.recording.folders import make_folder
from surgsim.recording.sealed import sealed
from surgsim.runs.provenance import provenance
from surgsim.scenario.yaml_text import dump_yaml
from surgsim.tuning.cost import WEIGHTS
from surgsim.tuning.tune import EVALUATIONS
from surgsim.tuning.tuning import Candidate, Margins, Tuning, means

SUMMARY = "tuning.json"
SCHEMA_VERSION = 1


def controller_file(tuning: Tuning) -> str:
    """Name of the controller's file."""
    return f"{tuning.name}.yaml"


def open_folder(folder: Path, tuning: Tuning, *, resume: bool) -> None:
    """Make the folder, or see that one that is there may be gone on with.

    Raises:
        SurgsimError: If it holds something else, or a tuning and `resume` is not asked for.
    """
    try:
        make_folder(folder)
        names = {path.name for path in folder.iterdir() if not path.name.endswith(".partial")}
    except OSError as error:
        raise SurgsimError(f"cannot write {folder}: {error.strerror or error}") from error
    foreign = names - {EVALUATIONS, SUMMARY, controller_file(tuning)}
    if foreign:
        raise SurgsimError(
            f"{folder} holds '{min(foreign)}', which is not of this tuning; choose another --out"
        )
    if names and not resume:
        raise SurgsimError(f"{folder} holds a tuning; give --resume to go on with it, or another --out")


def write_tuning(folder: Path, tuning: Tuning, *, finished: bool) -> None:
    """Write `tuning.json` and the controller's file, each whole or not at all.

    Raises:
        SurgsimError: If the disk refuses.
    """
    with replacing(folder / SUMMARY) as draft:
        write_file(draft, json.dumps(sealed(summary_of(tuning, finished=finished)), indent=2) + "\n")
    with replacing(folder / controller_file(tuning)) as draft:
        write_file(draft, controller_text(tuning, finished=finished))


def summary_of(tuning: Tuning, *, finished: bool) -> dict[str, Any]:
    """All of a tuning as plain data."""
    wish, before, best = tuning.wish, tuning.before, tuning.best
    gains = {
        gain.key: {
            "before": before.values[gain.key],
            "after": best.values[gain.key],
            "at_the_edge": gain.is_at_the_edge(best.values[gain.key]),
        }
        for gain in tuning.gains
    }
    return {
        "schema_version": SCHEMA_VERSION,
        "finished": finished,
        "controller": tuning.controller.name,
        "tuned": tuning.name,
        "file": controller_file(tuning),
        **asdict(wish),
        "runs": tuning.runs,
        "candidates": len(tuning.tried),
        "best": best.number,
        "cost": {"before": before.cost, "after": best.cost, "weights": asdict(WEIGHTS)},
        "gains": gains,
        "metrics": {
            name: {"before": dict(means(before.trials, name)), "after": dict(means(best.trials, name))}
            for name in tuning.scenario_names
        },
        "margins": None if tuning.margins is None else asdict(tuning.margins),
        "provenance": {**provenance(), "cmaes": version("cmaes")},
    }


def controller_text(tuning: Tuning, *, finished: bool) -> str:
    """The controller's file, with where it comes from at its head."""
    tree: Mapping[str, Any] = json.loads(tuning.tuned().model_dump_json())
    head = "".join(f"# {line}\n" for line in _head(tuning, finished=finished))
    return head + dump_yaml(tree)


def _head(tuning: Tuning, *, finished: bool) -> list[str]:
    wish, before, best, origin = tuning.wish, tuning.before, tuning.best, provenance()
    lines = [
        f"{tuning.controller.name}, tuned by surgsim tune {wish.controller}",
        f"scenarios: {', '.join(wish.scenarios)}",
        f"settings: {', '.join(wish.settings) or 'none'}",
        f"tuning seeds: {wish.seeds} (evaluate with others)",
        f"budget: {count(wish.budget, 'run')}, {tuning.runs} taken, "
        f"{count(len(tuning.tried), 'candidate')}, optimiser's seed {wish.seed}",
        f"cost: {number(before.cost)} before, {number(best.cost)} after; "
        f"failed runs: {_failed(before)} before, {_failed(best)} after, of {len(best.trials)}",
        *margin_lines(tuning.margins),
        f"surgsim {origin['surgsim']}, commit {origin['commit'] or 'unknown'}",
    ]
    if not finished:
        lines.append("interrupted: the best of what was tried until then")
    return [" ".join(line.split()) for line in lines]


def margin_lines(margins: Margins | None) -> list[str]:
    """The margins in words."""
    if margins is None:
        return ["margins: not measured"]
    delay, factor = "none", "none"
    if margins.delay_s is not None:
        sign = ">= " if margins.delay_s >= margins.delay_most_s else ""
        delay = f"{sign}{number(1e3 * margins.delay_s, 3)} ms of extra delay"
    if margins.gain_factor is not None:
        sign = ">= " if margins.gain_factor >= margins.gain_most else ""
        factor = f"{sign}{number(margins.gain_factor, 3)} times the tuned gains"
    return [f"delay margin: {delay}", f"gain margin: {factor}"]


def _failed(candidate: Candidate) -> int:
    return sum(not trial.completed for trial in candidate.trials)
