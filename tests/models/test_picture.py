"""Still pictures: drawn in a process of its own, and what is said where this machine cannot draw."""

import ctypes.util
import os
import subprocess
import sys

import mujoco
import numpy as np
import pytest

from surgsim.errors import SurgsimError
from surgsim.models.build import Scene, build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.models.picture import render


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build(SceneConfig(robot=RobotConfig(name="lwr4plus")))


def test_an_unknown_camera_is_refused(scene):
    with pytest.raises(SurgsimError) as caught:
        render(scene, np.zeros(7), "ceiling")
    assert str(caught.value) == "camera: 'ceiling' is not a camera. Known: overview, port_closeup."


def test_without_opengl_the_message_says_what_to_do(scene, monkeypatch):
    def no_gl(*args: object, **kwargs: object) -> None:
        raise mujoco.FatalError("gladLoadGL error")

    monkeypatch.setattr(mujoco, "Renderer", no_gl)
    with pytest.raises(SurgsimError, match=r"no OpenGL.*MUJOCO_GL=osmesa.*\(gladLoadGL error\)"):
        render(scene, np.zeros(7))


DRAW = """
import numpy as np
from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.models.picture import render

scene = build(SceneConfig(robot=RobotConfig(name="lwr4plus")))
one, two = (render(scene, np.full(7, angle), width=160, height=120) for angle in (0.0, 0.6))
print(one.shape, one.dtype, round(float(one.std())), round(float(np.abs(one.astype(int) - two).max())))
"""


@pytest.mark.needs("opengl")
def test_a_picture_shows_the_arm_where_it_is():
    backend = "egl" if ctypes.util.find_library("EGL") else "osmesa"
    done = subprocess.run(
        [sys.executable, "-c", DRAW],
        env={**os.environ, "MUJOCO_GL": backend},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("(120, 160, 3) uint8 ")
    spread, change = done.stdout.split()[-2:]
    assert int(spread) > 10, "the picture is not of one colour"
    assert int(change) > 50, "the arm has moved"
