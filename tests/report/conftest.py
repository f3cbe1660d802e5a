"""The made-up results directory of `tests/compare`, and scenes that take no time to draw."""

import base64
import importlib.util
import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from surgsim.compare.table import read_table
from surgsim.metrics.catalog import METRICS
from surgsim.report import scenes
from surgsim.report.scenes import SceneView

_FILE = Path(__file__).parents[1] / "compare" / "conftest.py"
_SPEC = importlib.util.spec_from_file_location("surgsim_made_results", _FILE)
_MODULE = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_MODULE)

made_results = _MODULE.made_results


def _pixel() -> str:
    """A JPEG of one pixel, in base64."""
    written = io.BytesIO()
    Image.new("RGB", (1, 1)).save(written, "JPEG")
    return base64.b64encode(written.getvalue()).decode()


PIXEL = _pixel()


@pytest.fixture
def made_up():
    """Functions that make results directories."""
    return _MODULE


def view(picture: str | None = PIXEL) -> SceneView:
    """A scene with a bent arm."""
    return SceneView(
        scenario="circle <1>",
        robot="lwr4plus",
        base=(0.0, 0.0, 0.0),
        joints=((0.0, 0.0, 0.3), (0.0, 0.2, 0.7), (0.0, 0.5, 0.5)),
        tip=(0.0, 0.55, 0.0),
        trocar=(0.0, 0.55, 0.2),
        path=((0.0, 0.55, 0.0), (0.02, 0.55, 0.0)),
        picture=picture,
    )


@pytest.fixture(scope="session")
def wide_results(made_results, tmp_path_factory):
    """A results directory of twelve controllers with long names, each with every metric."""
    rng = np.random.default_rng(3)
    given = read_table(made_results()).rows()
    rows = []
    for row in (row for row in given if row["seed"] < 6):
        for k in range(3):
            size = 10.0 ** rng.uniform(-4.0, 4.0)
            there = {name: row[name] if row[name] is not None else size * rng.random() for name in METRICS}
            folder = f"{row['folder']}-{k}"
            named = {"controller": f"{row['controller']}_{k}", "folder": folder, "run_id": folder}
            rows.append({**row, **there, **named})
    root = tmp_path_factory.mktemp("wide")
    _MODULE.write_results(root, rows)
    return root


@pytest.fixture
def scene_view():
    """Makes a scene with a picture or without."""
    return view


@pytest.fixture(autouse=True, scope="session")
def quick_scenes():
    """Every page shows the same scene; a test of the drawing asks for `scenes.look` before it is replaced."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scenes, "drawn", scenes.look, raising=False)
        patch.setattr(scenes, "look", lambda scenarios: (view(),))
        yield
