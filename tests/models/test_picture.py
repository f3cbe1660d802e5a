"""What the picture command says when it cannot draw. Drawing itself needs OpenGL and is not tested here."""

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
