"""What the scenes of some scenarios look like; to draw them, worked out in a process of its own.

A machine without OpenGL may end the process that draws, or leave it waiting. So the report asks this one, by
JSON on standard input and output. Where there is no answer, or nothing can be drawn, it calls `main` itself,
which then draws nothing.
"""

import base64
import io
import json
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from surgsim.errors import SurgsimError
from surgsim.models.arm import ArmModel
from surgsim.models.picture import render
from surgsim.packages import require
from surgsim.scenario.arms import Experiment, drawn_scenes, each_arm
from surgsim.scenario.load import load_experiment
from surgsim.simulate.setup import beginning

MOST = 2
"""Scenes that are drawn: the first of each robot."""
WIDTH, HEIGHT = 880, 560
_QUALITY = 80


def main(asked: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Scenes of the first scenario of each robot; `scenarios` are names or paths, `draw` wants pictures."""
    found: dict[str, dict[str, Any]] = {}
    for name in asked["scenarios"]:
        try:
            scenario = load_experiment(name)
            label = " and ".join(one.robot.label for one in each_arm(scenario))
            if label not in found:
                found[label] = _scene(scenario, label, draw=bool(asked["draw"]))
        except SurgsimError:
            continue  # a scenario that is no longer at hand; another may be
        if len(found) == MOST:
            break
    return list(found.values())


def _scene(scenario: Experiment, label: str, *, draw: bool) -> dict[str, Any]:
    """Points of the first arm at its start, the port, the tip's path, and a picture as JPEG in base64."""
    each = each_arm(scenario)
    begins = [beginning(one, ArmModel(one.scene)) for one in each]
    (q_start, task), first = begins[0], each[0]
    kin, trocar = ArmModel(first.scene).kinematics(q_start), first.trocar
    return {
        "scenario": scenario.name,
        "robot": label,
        "base": list(first.robot.base_position_m),
        "joints": _points(kin.anchors_W),
        "tip": kin.p_WT.tolist(),
        "trocar": None if trocar is None else list(trocar.position_m),
        "path": _points([point for _, point in task.reach()]),
        "picture": _picture(scenario, [q for q, _ in begins]) if draw else None,
    }


def _points(points: Sequence[Any] | np.ndarray) -> list[list[float]]:
    return [[float(x) for x in point] for point in points]


def _picture(scenario: Experiment, starts: Sequence[np.ndarray]) -> str | None:
    """The scene as camera `overview` sees it; None where this machine cannot draw."""
    try:
        require("pictures need", "PIL")
        pixels = render(drawn_scenes(scenario), starts, "overview", WIDTH, HEIGHT)
    except SurgsimError:
        return None
    from PIL import Image

    written = io.BytesIO()
    Image.fromarray(pixels).save(written, "JPEG", quality=_QUALITY, optimize=True)
    return base64.b64encode(written.getvalue()).decode()


if __name__ == "__main__":
    answer = main(json.load(sys.stdin))
    sys.stdout.write(json.dumps(answer))
