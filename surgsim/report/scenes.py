"""The scenes of a batch: pictures where this machine can draw them, points for schematics where not."""

import json
import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from surgsim.packages import lacking
from surgsim.report.results import Results
from surgsim.report.scene_process import main
from surgsim.resources import run_module

_LONGEST_S = 120.0
_NO_DRAWING = ("disable", "disabled", "off", "false", "0")
"""What MuJoCo takes for the wish not to draw."""
Point = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class SceneView:
    """A scene at the start of a scenario, positions in the world frame [m].

    Attributes:
        scenario: Name of the scenario.
        robot: Name of the arm.
        base: Where the arm stands.
        joints: Points on the joint axes, from the base on.
        tip: The instrument's tip.
        trocar: The port; None without one.
        path: Points that the tip is to pass.
        picture: A JPEG in base64; None where the machine cannot draw.
    """

    scenario: str
    robot: str
    base: Point
    joints: tuple[Point, ...]
    tip: Point
    trocar: Point | None
    path: tuple[Point, ...]
    picture: str | None


def scenes_of(results: Results) -> tuple[SceneView, ...]:
    """The scenes of the first scenario of each arm; none where the scenarios are not at hand."""
    return look(tuple(_source(results, name) for name in results.runs.scenarios))


def _source(results: Results, name: str) -> str:
    """The scenario's file in the folder of its first run, or its name."""
    folders = (row["folder"] for row in results.rows if row["scenario"] == name and row["folder"])
    file = results.folder / str(next(folders, "")).lstrip("/") / "scenario.yaml"
    return str(file.resolve()) if file.is_file() else name


@lru_cache(maxsize=64)
def look(scenarios: tuple[str, ...]) -> tuple[SceneView, ...]:
    """Scenes of scenarios, given by name or path."""
    undrawn = None
    for environment in _environments():
        found = _ask({"scenarios": scenarios, "draw": True}, environment)
        if found is not None and all(scene["picture"] for scene in found):
            return tuple(map(_view, found))
        undrawn = undrawn or found
    if undrawn is None:  # nobody could draw, or every process that was to was lost
        undrawn = main({"scenarios": scenarios, "draw": False})
    return tuple(map(_view, undrawn))


def _environments() -> list[dict[str, str]]:
    """Where MuJoCo is told how to draw: what the user says, else without a display first."""
    own = dict(os.environ)
    if lacking("", "OpenGL", "PIL") or own.get("MUJOCO_GL", "").lower() in _NO_DRAWING:
        return []
    return [own] if "MUJOCO_GL" in own else [{**own, "MUJOCO_GL": "egl"}, own]


def _ask(asked: dict[str, Any], environment: dict[str, str]) -> list[dict[str, Any]] | None:
    """The answer of the process that draws; None where it fails or takes too long."""
    try:
        done = run_module(
            "surgsim.report.scene_process",
            timeout_s=_LONGEST_S,
            given=json.dumps(asked).encode(),
            environment=environment,
        )
        answer = json.loads(done.stdout) if done.returncode == 0 else None
    except (OSError, subprocess.TimeoutExpired, ValueError):
        return None
    return answer if isinstance(answer, list) else None


def _view(scene: dict[str, Any]) -> SceneView:
    return SceneView(
        scenario=scene["scenario"],
        robot=scene["robot"],
        base=_point(scene["base"]),
        joints=tuple(map(_point, scene["joints"])),
        tip=_point(scene["tip"]),
        trocar=None if scene["trocar"] is None else _point(scene["trocar"]),
        path=tuple(map(_point, scene["path"])),
        picture=scene["picture"],
    )


def _point(values: Sequence[float]) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z
