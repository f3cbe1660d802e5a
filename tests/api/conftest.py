"""A short run in memory, the same in a folder, and a batch."""

from pathlib import Path
from typing import Any

import pytest

import surgsim

TASK = {"duration_s": 0.3, "ramp_s": 0.1, "hold_start_s": 0.0, "hold_end_s": 0.0, "radius_m": 0.002}


@pytest.fixture(scope="session")
def quick() -> dict[str, Any]:
    """Overrides for a run of 0.3 s."""
    return {"theatre": False, "task": TASK}


@pytest.fixture(scope="session")
def made(quick) -> surgsim.Run:
    """A run in memory."""
    return surgsim.run("circle_lwr4plus", controller="pinv", seed=3, **quick)


@pytest.fixture(scope="session")
def folder(quick, tmp_path_factory) -> Path:
    """The folder of the same run."""
    out = tmp_path_factory.mktemp("api") / "run"
    surgsim.run("circle_lwr4plus", controller="pinv", seed=3, out=out, **quick)
    return out


@pytest.fixture(scope="session")
def batch(quick, tmp_path_factory) -> Path:
    """The results of a batch of four runs, without recordings."""
    out = tmp_path_factory.mktemp("api") / "batch"
    controllers = ["pinv", "qp"]
    surgsim.compare("circle_lwr4plus", controllers=controllers, seeds=range(2), jobs=1, out=out, **quick)
    return out
