"""Runs every scenario for the gallery: a moving picture of each, and its result in `gallery/results.json`.

Only those are run whose picture or result is of another scenario than that of now.
"""

import json
import sys
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from stamps import assets, digest, mark, stamped

import surgsim
from surgsim.api.available import available
from surgsim.api.run import Run
from surgsim.export.overlay import figures, written
from surgsim.export.replayed import replayed
from surgsim.export.video import picture_times, row_at, side_by_side
from surgsim.models.drawing import Picture
from surgsim.scenario.arms import each_arm
from surgsim.scenario.load import load_experiment
from surgsim.scenario.schema import Scenario
from surgsim.trace.trace import Trace

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).parent / "gallery"
RESULTS = HERE / "results.json"
EXTERNALS = {
    "safety/external_failed": {"mine": "python examples/external/python/controller.py --dies-at 0.5"}
}
"""Commands of external controllers that scenarios need, by the scenario's name."""
SEEDS = {"random_": 1}
"""Seeds that are shown instead of the usual one, by what names start with: 0 draws a path out of reach."""
FIGURES = ("rcm_error_max_mm", "tip_error_max_mm", "delivered_excess_j", "rings_transferred")
"""Metrics that a result holds where the run defines them, of several arms those of each."""
CAMERAS = {
    "breathing_": ("port_closeup", "inside"),
    "endoscope_and_tool_": ("overview", "lens"),
    "peg_and_ring_": ("inside", "endoscope"),
    "rcm_moving_trocar_": ("port_closeup", "inside"),
    "safety/incision_torn": ("port_closeup", "inside"),
    "safety/patient_collision": ("overview", "port_closeup"),
    "safety/rcm_limit": ("port_closeup", "inside"),
}
"""Two cameras, by what the names of scenarios start with."""
USUAL_CAMERAS = ("overview", "inside")
SPEEDS = (0.1, 0.2, 0.25, 0.5, 1, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 40, 60)
"""How many times as fast as the run a picture can be."""
_SIDE, _PICTURES, _COLOURS, _LINES = 240, 16, 64, 17
_PERIOD_S = 0.15
_END_S, _STOP_PICTURES = 1.2, 4


def stamp(name: str) -> str:
    """What picture and result of a scenario are made from: the scenario, its assets, and the cameras."""
    scenario = load_experiment(name, seed=seed(name))
    used = [told for folder, told in _assets() if _is_used(folder, each_arm(scenario))]
    return digest([scenario.sha256(), *_cameras(name), *EXTERNALS.get(name, {}).values(), *used])


def _is_used(folder: tuple[str, ...], arms: Sequence[Scenario]) -> bool:
    """Whether arms are made of the assets of a folder: of their robots', and props' where jaws are hinged."""
    if folder[0] == "robots":
        return folder[1] in {one.robot.name for one in arms}
    hinged = any(getattr(prop, "hold", "") == "friction" for one in arms for prop in one.props)
    return folder[0] != "props" or hinged


@lru_cache(maxsize=1)
def _assets() -> list[tuple[tuple[str, ...], str]]:
    """Folders below `assets` and hash of every file that a shipped scenario can be made of."""
    return [(folder, told) for folder, told in assets() if folder[0] != "test_arms"]


def _cameras(name: str) -> tuple[str, str]:
    return next((found for start, found in CAMERAS.items() if name.startswith(start)), USUAL_CAMERAS)


def seed(name: str) -> int | None:
    """The seed with which a scenario is run; None: its own."""
    return next((found for start, found in SEEDS.items() if name.startswith(start)), None)


def picture(name: str) -> Path:
    """The file of a scenario's moving picture."""
    return HERE / f"{name.replace('/', '_')}.gif"


def results() -> dict[str, dict[str, Any]]:
    """The results that are kept, by scenario."""
    if not RESULTS.is_file():
        return {}
    found: dict[str, dict[str, Any]] = json.loads(RESULTS.read_text(encoding="utf-8"))
    return found


def out_of_date() -> list[str]:
    """Scenarios without a picture and a result of what they are now."""
    held = results()
    return [name for name in available("scenarios") if _stamps(name, held) != {stamp(name)}]


def _stamps(name: str, held: dict[str, dict[str, Any]]) -> set[str]:
    """Stamps of a scenario's picture and result; empty texts for what is not there."""
    file = picture(name)
    return {stamped(file) if file.is_file() else "", held.get(name, {}).get("stamp", "")}


def run(name: str) -> Run:
    """A run of a scenario, in memory."""
    here = {"python": sys.executable}
    commands = {
        external: " ".join(here.get(word, word) for word in command.split())
        for external, command in EXTERNALS.get(name, {}).items()
    }
    return surgsim.run(name, seed=seed(name), externals=commands)


def result(run: Run) -> dict[str, Any]:
    """What is kept of a run: how it ended, whether its task was done, and its figures to four digits."""
    ending, verdict = run.trace.meta.ending, run.verdict
    wanted = [f"{arm}_{name}" for arm in run.trace.arms for name in FIGURES] or FIGURES
    return {
        "outcome": run.outcome,
        "t_s": round(ending.t_s, 3),
        "detail": ending.detail,
        "success": run.success,
        "reason": verdict.reason,
        "exceeded": [f"`{held.metric}` {held.figure} exceeds {held.most:g}" for held in verdict.exceeded],
        "speed": _speed(run.trace),
        "figures": {key: _short(run.metrics[key]) for key in wanted if run.metrics[key] is not None},
    }


def _short(value: float | None) -> float:
    return float(f"{value:.4g}")


def _speed(trace: Trace) -> float:
    """The least speed at which the run fits into its pictures."""
    end_s = float(trace.active()["t_s"][-1])
    return next(speed for speed in SPEEDS if end_s <= speed * _PERIOD_S * _PICTURES)


def draw(name: str, trace: Trace) -> None:
    """Write the moving picture of a run.

    Raises:
        SurgsimError: If this machine cannot draw.
    """
    every = list(_pictures(name, trace))
    palette = Image.fromarray(np.hstack([every[k * (len(every) - 1) // 3] for k in range(4)])).quantize(
        _COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE
    )
    first, *others = [
        Image.fromarray(one).quantize(palette=palette, dither=Image.Dither.NONE) for one in every
    ]
    HERE.mkdir(exist_ok=True)
    about: dict[str, Any] = {"duration": round(1e3 * _PERIOD_S), "loop": 0, "optimize": True}
    first.save(picture(name), save_all=True, append_images=others, **about)
    mark(picture(name), stamp(name))


def _pictures(name: str, trace: Trace) -> Iterator[Picture]:
    """The run by both cameras; its end stays for a while, then the stop follows if there is one."""
    speed, t_s, end = _speed(trace), trace["t_s"], len(trace.active()) - 1
    outcome = trace.meta.ending.outcome.name.lower()
    rows = [row_at(t_s, float(time)) for time in picture_times(float(t_s[end]), speed * _PERIOD_S)]
    held = [end] * round(_END_S / _PERIOD_S)
    last, pace = len(trace) - 1, "real time" if speed == 1 else f"{speed:g} times real time"
    stop = np.linspace(end, last, _STOP_PICTURES + 1).astype(int)[1:].tolist() if last > end else []
    with replayed(trace, _SIDE, _SIDE) as look:
        for row in [*rows, *held, *stop]:
            ended = row >= end and outcome != "completed"
            head = f"ended as {outcome}" if ended else pace
            both = side_by_side([look.picture(row, camera) for camera in _cameras(name)], 2)
            yield written(both, head, figures(trace, row), lines=_LINES)


def keep(name: str, found: dict[str, Any]) -> None:
    """Put a result among those that are kept; those of scenarios that are no more are dropped."""
    known = available("scenarios")
    held = {**results(), name: found}
    told = {one: held[one] for one in known if one in held}
    RESULTS.write_text(json.dumps(told, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    for file in set(HERE.glob("*.gif")) - set(map(picture, known)):
        file.unlink()


def main(names: Sequence[str] = ()) -> None:
    """Make what is out of date, or what is named.

    Raises:
        SurgsimError: If a scenario cannot be started, or this machine cannot draw.
    """
    wanted = list(names) or out_of_date()
    for count, name in enumerate(wanted, start=1):
        print(f"{count} of {len(wanted)}: {name}", flush=True)
        found = run(name)
        draw(name, found.trace)
        keep(name, {"stamp": stamp(name), **result(found)})
