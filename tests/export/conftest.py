"""A short recorded run, the same without recording, and the made-up batch of `tests/compare`."""

import importlib.util
from pathlib import Path

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
