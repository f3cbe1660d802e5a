"""Writes the page `docs/gallery.md` from the shipped scenarios; `tests/test_made.py` compares the two."""

import sys
from dataclasses import dataclass
from pathlib import Path

from surgsim.api.available import available

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
        text="Another port, path and load for every seed: [drawn scenarios](batch.md#drawn-scenarios).",
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

<!-- made by docs/images/gallery.py from the shipped scenarios: `make pictures` -->

Every scenario that comes with surgsim, with the command that runs it. `surgsim inspect` shows a run's
figures, and with `--view` the run itself.

## A recording in the viewer

Every recorded run can be looked at from all sides, and at every moment. The site (`make docs`) holds this one
and the viewer. Serve the site by `python -m http.server --directory build/site`: no browser starts the viewer
from a file.

![The recording of the circle in the viewer](images/recording.png)

<!-- recording in the viewer -->
"""


def page() -> str:
    """The page.

    Raises:
        ValueError: If a scenario is in no group.
    """
    left = available("scenarios")
    parts = [_HEAD]
    for group in GROUPS:
        names = [name for name in left if name.startswith(group.starts)]
        parts.append(f"\n## {group.title}\n\n{group.text}\n")
        parts += [f"\n![{text}](images/{file})\n\n*{text}*\n" for file, text in group.pictures.items()]
        parts += ["\n", *(_line(name, left.pop(name)) for name in names)]
    if left:
        raise ValueError(f"the gallery has no group for {', '.join(left)}")
    return "".join(parts)


def _line(name: str, description: str) -> str:
    more = " --external mine=COMMAND" if name == "safety/external_failed" else ""
    return f"- {description.partition(' (give an')[0]}: `surgsim run {name}{more}`\n"


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE)


if __name__ == "__main__":
    sys.exit(main())
