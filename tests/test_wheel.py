"""The wheel stands on its own: built, unpacked elsewhere and used from a folder that is no checkout."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from email import message_from_bytes
from email.message import Message
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

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
def small_wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of the small installation."""
    folder = tmp_path_factory.mktemp("small")
    source = ROOT / "core"
    call(*PIP, "wheel", "--no-index", "--no-build-isolation", "--no-deps", "-w", folder, source, cwd=folder)
    (built,) = folder.glob("surgsim_core-*.whl")
    return built


def metadata_of(wheel: Path) -> Message:
    with zipfile.ZipFile(wheel) as file:
        (name,) = (name for name in file.namelist() if name.endswith(".dist-info/METADATA"))
        return message_from_bytes(file.read(name))


def requirements_of(wheel: Path) -> dict[str, Requirement]:
    """What the wheel needs without extras, by name."""
    every = map(Requirement, metadata_of(wheel).get_all("Requires-Dist", []))
    return {canonicalize_name(one.name): one for one in every if "extra" not in str(one.marker)}


def test_the_small_wheel_holds_the_same_files(wheel: Path, small_wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as plain, zipfile.ZipFile(small_wheel) as small:
        held = [
            {one.filename: one.CRC for one in file.infolist() if ".dist-info/" not in one.filename}
            for file in (plain, small)
        ]
        commands = [
            file.read(next(name for name in file.namelist() if name.endswith("entry_points.txt")))
            for file in (plain, small)
        ]
        assert any(name.endswith("licenses/LICENSE") for name in small.namelist())
    assert held[0] == held[1]
    assert commands[0] == commands[1]


def test_the_small_wheel_needs_less_in_the_same_releases(wheel: Path, small_wheel: Path) -> None:
    plain, small = requirements_of(wheel), requirements_of(small_wheel)
    kept = {"mujoco" if name == "mujoco-core" else name: one.specifier for name, one in small.items()}
    assert kept.items() < {name: one.specifier for name, one in plain.items()}.items()
    left_out = {"rerun-sdk", "pyarrow", "dm-control", "dm-env", "mink", "matplotlib", "pillow"}
    assert plain.keys() - kept.keys() == left_out | {"osqp", "qpsolvers"}
    told, ours = metadata_of(wheel), metadata_of(small_wheel)
    for field in ("Version", "Summary", "License-Expression", "Requires-Python"):
        assert told[field] == ours[field]


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
