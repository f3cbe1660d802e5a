"""A short recorded run, the same without recording, and the made-up batch of `tests/compare`."""

import importlib.util
from pathlib import Path

import mujoco
import numpy as np
import pytest

from surgsim.cli.main import main
from surgsim.export.subjects import RunSubject, find
from surgsim.runs.folder import run_to_folder

_FILE = Path(__file__).parents[1] / "compare" / "conftest.py"
_SPEC = importlib.util.spec_from_file_location("surgsim_made_results_of_export", _FILE)
_MODULE = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_MODULE)

made_results = _MODULE.made_results


@pytest.fixture(scope="session")
def run_folder(scenario, tmp_path_factory) -> Path:
    """A run of 0.3 s in its theatre, recorded."""
    folder = tmp_path_factory.mktemp("export") / "run"
    run_to_folder(scenario("theatre=true", controller="pinv", seed=3), folder)
    return folder


@pytest.fixture(scope="session")
def unrecorded(scenario, tmp_path_factory) -> Path:
    """A run without recording."""
    folder = tmp_path_factory.mktemp("export") / "unrecorded"
    run_to_folder(scenario(controller="pinv"), folder, record=False)
    return folder


@pytest.fixture(scope="session")
def run(run_folder) -> RunSubject:
    """The recorded run."""
    found = find(str(run_folder))
    assert isinstance(found, RunSubject)
    return found


@pytest.fixture
def told(capsys):
    """Runs `surgsim export` and returns its status and what it says on standard error."""

    def call(*words) -> tuple[int, str]:
        status = main(["export", *map(str, words)])
        return status, capsys.readouterr().err

    return call


class Blind(mujoco.Renderer):
    """MuJoCo's renderer without OpenGL: it makes the scene, and pictures that tell its time and camera."""

    seen: list = []  # noqa: RUF012

    def __init__(self, model, height, width, max_geom):
        self._gl_context = self._mjr_context = None
        self._model, self._height, self._width = model, height, width
        self._scene = mujoco.MjvScene(model=model, maxgeom=max_geom)
        self._scene_option = mujoco.MjvOption()

    def update_scene(self, data, camera=-1, scene_option=None):
        super().update_scene(data, camera, scene_option)
        self.asked = (data.qpos.copy(), camera, self._scene.ngeom)

    def render(self, *, out=None):
        Blind.seen.append((self, *self.asked, self._scene.ngeom))
        return np.full((self._height, self._width, 3), 40 * len(Blind.seen) % 256, dtype=np.uint8)


@pytest.fixture
def blind(monkeypatch):
    """What was drawn: renderer, joint positions, camera, geoms without and with lines."""
    monkeypatch.setattr(mujoco, "Renderer", Blind)
    monkeypatch.setattr(Blind, "seen", [])
    return Blind.seen
