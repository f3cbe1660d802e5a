"""The wheel stands on its own: built, unpacked elsewhere and used from a folder that is no checkout."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from surgsim.scenario.drawn import drawn_names

ROOT = Path(__file__).resolve().parents[1]
PIP = (sys.executable, "-m", "pip", "--quiet", "--no-input", "--disable-pip-version-check")


def call(*command: object, cwd: Path, **variables: str) -> str:
    """Standard output of a command that must succeed."""
    done = subprocess.run(
        [str(word) for word in command],
        cwd=cwd,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert done.returncode == 0, f"{command}: exit {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    call(*PIP, "wheel", "--no-index", "--no-build-isolation", "--no-deps", "-w", folder, ROOT, cwd=folder)
    (built,) = folder.glob("*.whl")
    return built


def test_it_holds_every_module_asset_and_scenario(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as file:
        packed = set(file.namelist())
    modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "surgsim").rglob("*.py")}
    data = {
        f"surgsim/_data/{path.relative_to(ROOT).as_posix()}"
        for folder, kinds in (("assets", ".xml"), ("scenarios", ".yaml"))
        for path in (ROOT / folder).rglob(f"*{kinds}")
    }
    assert len(modules) > 50
    assert len(data) > 5
    assert (modules | data) - packed == set()
    assert "surgsim/py.typed" in packed
    assert not [name for name in packed if name.startswith(("tests/", "docs/")) or "__pycache__" in name]


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that the wheel is installed into, with what kernels the checkout has of the same sources."""
    target = tmp_path_factory.mktemp("installed")
    call(*PIP, "install", "--no-index", "--no-deps", "--target", target, wheel, cwd=target)
    kernels = Path("surgsim", "__pycache__", "kernels")
    (target / kernels).mkdir(parents=True)
    for kernel in (ROOT / kernels).glob("*.nbi"):
        shutil.copy(kernel, target / kernels)
    return target


def test_it_runs_a_shipped_scenario_by_name_from_anywhere(installed: Path, tmp_path: Path) -> None:
    def python(*words: str) -> str:
        return call(sys.executable, "-W", "error", *words, cwd=tmp_path, PYTHONPATH=str(installed))

    place = python("-c", "import surgsim; print(surgsim.__file__)").strip()
    assert Path(place).is_relative_to(installed)
    listed = json.loads(python("-m", "surgsim", "list", "scenarios", "--json"))
    assert {item["name"] for item in listed} == {
        *(path.stem for path in (ROOT / "scenarios").glob("*.yaml")),
        *(f"safety/{path.stem}" for path in (ROOT / "scenarios" / "safety").glob("*.yaml")),
        *drawn_names(),
    }
    short = ("--set", "task.duration_s=2", "--set", "task.hold_end_s=0")
    text = python("-m", "surgsim", "run", "circle_lwr4plus", "--no-record", "--json", "--out", "run", *short)
    assert json.loads(text)["outcome"]["t_s"] == pytest.approx(2.5)
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["metrics.json", "scenario.yaml"]
