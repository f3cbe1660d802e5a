"""The scenes of a batch: pictures where this machine can draw them, points for schematics where not."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from surgsim.report.results import Results

_LONGEST_S = 120.0
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
    tried = [(True, environment) for environment in _environments()] + [(False, dict(os.environ))]
    for draw, environment in tried:
        found = _ask({"scenarios": scenarios, "draw": draw}, environment)
        if found is not None and (not draw or all(scene["picture"] for scene in found)):
            return tuple(_view(scene) for scene in found)
    return ()


def _environments() -> list[dict[str, str]]:
    """Where MuJoCo is told how to draw: what the user says, else without a display first."""
    own = dict(os.environ)
    return [own] if "MUJOCO_GL" in own else [{**own, "MUJOCO_GL": "egl"}, own]


def _ask(asked: dict[str, Any], environment: dict[str, str]) -> list[dict[str, Any]] | None:
    """The answer of the process that draws; None where it fails or takes too long."""
    command = [sys.executable, "-m", "surgsim.report.scene_process"]
    root = str(Path(__file__).parents[2])
    paths = [root, environment.get("PYTHONPATH", "")]
    try:
        done = subprocess.run(
            command,
            input=json.dumps(asked),
            env={**environment, "PYTHONPATH": os.pathsep.join(path for path in paths if path)},
            capture_output=True,
            text=True,
            encoding="utf-8",
            timeout=_LONGEST_S,
            check=True,
        )
        answer = json.loads(done.stdout)
    except (OSError, subprocess.SubprocessError, ValueError):
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
