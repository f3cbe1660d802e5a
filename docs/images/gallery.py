"""Writes the page `docs/gallery.md` from the shipped scenarios and the results of their runs.

Scenarios are run where picture or result is out of date, by `gallery_runs`. Names as arguments are run in any
case: a change of the program is in no stamp. `tests/test_made.py` compares page and results.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gallery_runs

from surgsim.api.available import available
from surgsim.errors import SurgsimError
from surgsim.scenario.load import load_experiment
from surgsim.teleop.judgement import PASSIVE_J

PAGE = Path(__file__).resolve().parents[1] / "gallery.md"


@dataclass(frozen=True, kw_only=True)
class Group:
    """Scenarios of one kind.

    Attributes:
        title: Heading.
        starts: What the names of its scenarios start with.
        text: What they are for.
        pictures: What each picture shows, by its file in `docs/images`.
    """

    title: str
    starts: tuple[str, ...]
    text: str
    pictures: dict[str, str]


GROUPS = (
    Group(
        title="Paths through a fixed trocar",
        starts=("circle_", "sinusoid_", "spiral_"),
        text="The plain task: the tip follows a path, the shaft stays in the trocar, nothing disturbs.",
        pictures={
            "theatre.png": "LWR4+",
            "panda.png": "Panda",
            "fr3.png": "Franka Research 3",
            "iiwa14.png": "LBR iiwa 14",
            "paths.png": "The three paths, seen from the port",
        },
    ),
    Group(
        title="The operating theatre",
        starts=("theatre_",),
        text="Compliant wall, breathing port, unknown payload, noise and delay at once. "
        "Two use ideal drives, the others [real ones](drives.md). "
        "[What was measured](robustness.md#the-operating-theatre).",
        pictures={"theatre.gif": "Panda, real drives, from outside and from inside"},
    ),
    Group(
        title="A breathing patient",
        starts=("breathing_",),
        text="The port moves with the breath. It is tracked, or only a compliant wall tells of it.",
        pictures={"port_closeup.png": "The port from outside"},
    ),
    Group(
        title="Torque-level settings",
        starts=("rcm_",),
        text="The four settings in which torque-level RCM controllers are compared: "
        "[what they show](robustness.md#the-four-torque-level-settings).",
        pictures={},
    ),
    Group(
        title="Calibration, insertion, a leading hand",
        starts=("calibrated_", "insertion_", "hands_on_"),
        text="An arm learns its own geometry; the instrument goes in, planned or led by a hand: "
        "[calibration](robustness.md#calibration), [insertion](safety.md).",
        pictures={},
    ),
    Group(
        title="Two arms in one patient",
        starts=("two_ports_", "endoscope_and_tool_"),
        text="Two arms through ports 8 cm apart, each with its path, or one with an endoscope that looks at "
        "the other's: [several arms](several_arms.md).",
        pictures={
            "two_ports.png": "Two Pandas at their start",
            "endoscope.gif": "The tool's circle, four times as fast, and what the 30 degree endoscope sees",
        },
    ),
    Group(
        title="Teleoperation",
        starts=("teleop_", "peg_and_ring_"),
        text="An operator at a console, a delayed channel, energy tanks: [teleoperation](teleoperation.md), "
        "[peg and ring](peg_and_ring.md).",
        pictures={
            "rings.gif": "Three rings go from peg to peg, eight times as fast; below, the endoscope's view"
        },
    ),
    Group(
        title="Drawn by the seed",
        starts=("random_",),
        text="Another port, path and load for every seed: [drawn scenarios](batch.md#drawn-scenarios). "
        "Shown is seed 1: seed 0 draws a path that none of these arms reaches, and is refused.",
        pictures={},
    ),
    Group(
        title="Runs that end early",
        starts=("safety/",),
        text="Each ends with the [outcome](safety.md#outcomes) that it is named after, and exit status 1.",
        pictures={},
    ),
)

_HEAD = """# Gallery

<!-- made by docs/images/gallery.py from the shipped scenarios and their runs: `make pictures` -->

Every scenario that comes with surgsim: what it shows, the command that runs it, and how it ends with its own
controller and seed. `surgsim inspect` shows a run's other figures, and with `--view` the run itself.

A picture has two views, in most the theatre and the path in the patient: commanded light blue, travelled
black. Long runs are shown faster, short ones slower; each says by how much. "RCM max" is the largest distance
of the trocar from the shaft's axis, "tip max" that of the tip from its command. A teleoperated run is passive
if hand and surroundings got no more energy than was stored.

## A recording in the viewer

Every recorded run can be looked at from all sides, and at every moment. The site (`make docs`) holds this one
and the viewer. Serve the site by `python -m http.server --directory build/site`: no browser starts the viewer
from a file.

![The recording of the circle in the viewer](images/recording.png)

<!-- recording in the viewer -->
"""
_FIGURES = {"rcm_error_max_mm": "RCM max", "tip_error_max_mm": "tip max"}


def page() -> str:
    """The page.

    Raises:
        ValueError: If a scenario is in no group.
    """
    left, held = available("scenarios"), gallery_runs.results()
    parts = [_HEAD]
    for group in GROUPS:
        names = [name for name in left if name.startswith(group.starts)]
        parts.append(f"\n## {group.title}\n\n{group.text}\n")
        parts += [f"\n![{text}](images/{file})\\\n*{text}*\n" for file, text in group.pictures.items()]
        parts += [_card(name, left.pop(name), held.get(name, {})) for name in names]
    if left:
        raise ValueError(f"the gallery has no group for {', '.join(left)}")
    return "".join(parts)


def _card(name: str, description: str, found: Mapping[str, Any]) -> str:
    """Heading, picture, what it shows, command and result of a scenario; without a run what is there."""
    text = description.partition(" (give an")[0].replace("`", "").replace("teleoperated", "Teleoperated")
    programs, seed = gallery_runs.EXTERNALS.get(name, {}), gallery_runs.seed(name)
    more = "" if seed is None else f" --seed {seed}"
    more += "".join(f" --external {key}='{command}'" for key, command in programs.items())
    file = f"images/gallery/{gallery_runs.picture(name).name}"
    lines = [
        f"### {name}",
        f"![{text}]({file})" if found else "",
        f"{text}. Controller: `{load_experiment(name, seed=seed).controller_name}`.",
        f"`surgsim run {name}{more}`",
        f"{result(found)} {_pace(found['speed'])}" if found else "",
    ]
    return "".join(f"\n{line}\n" for line in lines if line)


def result(found: Mapping[str, Any]) -> str:
    """A result in a line: how it ended, whether its task was done, and the figures that matter."""
    if found["outcome"] != "completed":
        detail = found["detail"].removesuffix(".")
        ended = f"**Ends as `{found['outcome']}`** at {found['t_s']:.3g} s: {detail}"
    else:
        head = {True: "Done", False: "Not done", None: "Completed"}[found["success"]]
        ended = f"**{head}** in {found['t_s']:.3g} s: {found['reason']}"
        if found["success"] and found["exceeded"]:
            ended += f", but {' and '.join(found['exceeded'])}"
    figures = "; ".join(filter(None, (_figures(arm, found["figures"]) for arm in _arms(found["figures"]))))
    return f"{ended}. {figures}." if figures else f"{ended}."


def _arms(figures: Mapping[str, float]) -> list[str]:
    """What names of figures begin with: the arms where there are several, else nothing."""
    ends = "_rcm_error_max_mm"
    return [key.removesuffix(ends[1:]) for key in figures if f"_{key}".endswith(ends)] or [""]


def _figures(arm: str, figures: Mapping[str, float]) -> str:
    """The figures of an arm, in words."""
    told = [
        f"{text} {_short(figures[arm + key])} mm" for key, text in _FIGURES.items() if arm + key in figures
    ]
    excess, rings = figures.get(f"{arm}delivered_excess_j"), figures.get(f"{arm}rings_transferred")
    if rings is not None:
        told.append(f"{rings:g} rings transferred")
    if excess is not None:
        told.append("passive" if excess <= PASSIVE_J else f"not passive: {excess:.3g} J more than was stored")
    return (f"{arm.removesuffix('_')}: " if arm else "") + ", ".join(told)


def _short(value: float) -> str:
    """A length in mm to three digits; a micrometre is the least that is told."""
    return "below 0.001" if 0.0 <= value < 1e-3 else f"{float(f'{value:.3g}'):g}"


def _pace(speed: float) -> str:
    """How fast the picture is."""
    if speed == 1.0:
        return "*Shown as fast as it is.*"
    return f"*Shown {speed:g} times as fast.*" if speed > 1.0 else f"*Shown {1.0 / speed:g} times slower.*"


def main(names: Sequence[str] = ()) -> None:
    """Run what is out of date, or what is named, and write the page.

    Raises:
        SurgsimError: If a scenario cannot be started, or this machine cannot draw; the page is written.
    """
    try:
        gallery_runs.main(names)
    finally:
        PAGE.write_text(page(), encoding="utf-8")
        print(PAGE)


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except SurgsimError as error:
        sys.exit(str(error))
