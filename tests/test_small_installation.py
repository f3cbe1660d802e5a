"""The small installation: without what it leaves out, what it is for works, and the rest says a line."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import laboratory as lab
import pytest
from batches import short_run

import surgsim
import surgsim.env
from surgsim.bench.sections import bench_of
from surgsim.cli.main import main
from surgsim.packages import PACKAGES, MissingPackageError, lacking, missing

ROOT = Path(surgsim.__file__).parents[1]
CORE = tomllib.loads((ROOT / "core" / "pyproject.toml").read_text())
LEFT_OUT = CORE["tool"]["hatch"]["metadata"]["hooks"]["custom"]["left-out"]
MODULES = sorted(module for module, (package, _) in PACKAGES.items() if package in LEFT_OUT)
BLOCKED = f"""import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {[*MODULES, "OpenGL", "glfw"]}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent())
"""
SHORT = [word for setting in short_run() for word in ("--set", setting)]
CIRCLE = ("circle_lwr4plus", *SHORT)


def test_every_package_that_is_left_out_has_its_line():
    assert {PACKAGES[module][0] for module in MODULES} == set(LEFT_OUT)
    assert all(PACKAGES[module][1] == "surgsim" for module in MODULES)


def test_the_page_says_what_is_left_out():
    page = (ROOT / "docs" / "installation.md").read_text(encoding="utf-8")
    table = page.split("| left out | what does without |")[1].split("\n\n")[0]
    named = [re.findall(r"`([\w-]+)`", row.split("|")[1]) for row in table.splitlines() if row]
    assert sorted(name for row in named for name in row) == sorted(LEFT_OUT)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Runs the command in a folder of its own, where it and what it starts can import none of them."""
    folder, hook = tmp_path_factory.mktemp("small"), tmp_path_factory.mktemp("hook")
    (hook / "sitecustomize.py").write_text(BLOCKED)

    def python(*words, status=0):
        done = subprocess.run(
            [sys.executable, *map(str, words)],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": f"{hook}{os.pathsep}{ROOT}"},
            capture_output=True,
            text=True,
            timeout=500,
        )
        assert done.returncode == status, f"{words}: exit {done.returncode}\n{done.stdout}\n{done.stderr}"
        assert "Traceback" not in done.stderr
        return done

    def run(*words, status=0):
        return python("-m", "surgsim", *words, status=status)

    run.folder, run.python = folder, python
    return run


def test_none_of_them_can_be_imported_there(small):
    code = f"""
import importlib
for module in {MODULES}:
    try:
        importlib.import_module(module)
    except ModuleNotFoundError:
        continue
    print(module)
"""
    assert small.python("-c", code).stdout == ""


def test_a_run_without_recording(small):
    small("run", *CIRCLE, "--no-record", "--out", "run")
    assert sorted(path.name for path in (small.folder / "run").iterdir()) == ["metrics.json", "scenario.yaml"]
    said = small("inspect", "run", status=2).stderr
    assert said.startswith("surgsim: run: a run without recording, circle_lwr4plus with vprnn, completed")


def test_a_run_that_would_be_recorded_is_refused_before_it_begins(small):
    said = small("run", *CIRCLE, "--out", "recorded", status=2).stderr
    assert said == "surgsim: recordings need rerun-sdk: pip install surgsim, or --no-record\n"
    assert not (small.folder / "recorded").exists()


def test_a_batch_has_its_table_its_statistics_and_its_page(small):
    words = (
        "compare",
        *CIRCLE,
        "--controllers",
        "vprnn,pinv",
        "--seeds",
        "0:2",
        "--jobs",
        "2",
        "--out",
        "batch",
    )
    done = small(*words)
    assert "controller" in done.stdout
    assert done.stderr.endswith("wrote batch/runs.csv\nwrote batch/report.html\n")
    found = sorted(path.name for path in (small.folder / "batch").iterdir())
    assert found == ["report.html", "runs", "runs.csv", "runs.csv.sha256", "suite.json"]
    assert "4 runs of batch" in small("inspect", "batch").stdout
    assert "other code" not in small(*words, "--resume").stderr
    assert surgsim.read(small.folder / "batch").table["outcome"] == ("completed",) * 4
    small("report", "batch", "--out", "again.html")


def test_a_score_its_passport_and_its_verification(small):
    protocol = lab.short_protocol(small.folder)
    words = ("score", "pinv", "--protocol", protocol.path, "--store", "store", "--out", "score")
    said = small(*words, "--jobs", "1").stderr
    assert "the passport's chart is left out: it needs matplotlib: pip install surgsim\n" in said
    found = {path.name for path in (small.folder / "score").iterdir()}
    assert "passport.html" in found
    assert not {"passport.pdf", "passport.png"} & found
    small("submit", "score", "--out", "mine.zip", "--protocol", protocol.path)
    assert "VERIFIED" in small("verify", "mine.zip", "--protocol", protocol.path, "--jobs", "1").stdout


def test_lists_and_checks(small):
    assert "mink" in small("list", "controllers").stdout
    small("check", "circle_lwr4plus")
    small("list", "scenarios")


@pytest.fixture
def without(monkeypatch):
    """Makes modules impossible to import in this process."""

    def block(*modules):
        for module in modules:
            monkeypatch.setitem(sys.modules, module, None)

    return block


LINES = {
    "mink": (
        ["run", *CIRCLE, "--no-record", "--controller", "mink"],
        "the resolver 'mink' needs mink: pip install surgsim",
    ),
    "osqp": (
        ["run", *CIRCLE, "--no-record", "--controller", "qp", "--set", "controller.resolver.solver=osqp"],
        "the QP solver 'osqp' needs osqp: pip install surgsim",
    ),
    "qpsolvers": (
        ["run", *CIRCLE, "--no-record", "--controller", "qp", "--set", "controller.resolver.solver=clarabel"],
        "the QP solver 'clarabel' needs qpsolvers: pip install surgsim, or active_set, daqp, osqp",
    ),
    "rerun": (["run", *CIRCLE, "--live"], "recordings need rerun-sdk: pip install surgsim, or --no-record"),
    "pyarrow": (
        ["compare", *CIRCLE, "--record", "--out", "x"],
        "recordings need pyarrow: pip install surgsim, or leave the recordings out",
    ),
    "matplotlib": (["export", "x", "--figure", "x.pdf"], "--figure needs matplotlib: pip install surgsim"),
    "PIL": (["export", "x", "--video", "x.gif"], "--video needs pillow: pip install surgsim"),
    "dm_control": (["export", "x", "--minari", "x-v0"], "--minari needs dm-control: pip install surgsim"),
    "dm_env": (["export", "x", "--lerobot", "x"], "--lerobot needs dm-env: pip install surgsim"),
}


@pytest.mark.parametrize("module", LINES)
def test_a_part_whose_package_is_missing_says_so_in_one_line(module, without, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    without(module)
    words, line = LINES[module]
    assert main(words) == 2
    told = capsys.readouterr().err
    assert re.sub(r"\s+", " ", told).endswith(f"{line} ")
    assert list(tmp_path.iterdir()) == []


def test_the_small_one_says_what_comes_first(monkeypatch):
    monkeypatch.setattr("surgsim.packages.distribution", lambda name: name)
    for module in ("mink", "ray"):
        monkeypatch.setitem(sys.modules, module, None)
    assert lacking("it needs", "mink") == (
        "it needs mink: pip install surgsim (pip uninstall surgsim-core first)"
    )
    assert lacking("it needs", "ray") == "it needs ray: pip install 'surgsim-core[ray]'"


def test_every_part_that_is_left_out_is_tried_above():
    assert set(LINES) == set(MODULES)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["reproduce", "vprnn"], "figures need matplotlib: pip install surgsim, or --quick"),
        (["adopt", "{arm}"], "the map of ports needs matplotlib: pip install surgsim, or --quick"),
    ],
)
def test_what_draws(words, line, without, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    without("matplotlib")
    arm = next((ROOT / "assets" / "robots" / "panda").glob("*.xml"))
    assert main([word.format(arm=arm) for word in words]) == 2
    assert capsys.readouterr().err.endswith(f"surgsim: {line}\n")


def test_the_leaderboard_is_refused_before_its_first_run(without, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    without("mink")
    assert main(["score", "--all"]) == 2
    assert capsys.readouterr().err == (
        "surgsim: not every entry of surgsim_v1 can be run here: nominal/mink, velocity_level/mink: "
        "the resolver 'mink' needs mink: pip install surgsim; "
        "--track port_tracked or instrument_tracked or teleoperation can be run\n"
    )
    assert main(["score", "--all", "--track", "nominal"]) == 2
    assert capsys.readouterr().err == (
        "surgsim: not every entry of surgsim_v1 can be run here: nominal/mink: "
        "the resolver 'mink' needs mink: pip install surgsim\n"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_measurement_of_speed_leaves_out_what_it_cannot_run(without, capsys):
    without("mink", "rerun")
    line = "the resolver 'mink' needs mink: pip install surgsim"
    bench = bench_of(None, None, 10.0, 1)
    startup = "startup, its recording: recordings need rerun-sdk: pip install surgsim"
    assert bench.left_out == (f"circle/mink: {line}", startup)
    assert "circle/mink" not in [case.name for case in bench.cases]
    assert main(["bench", "--only", "ticks", "--cases", "circle/pinv,circle/mink"]) == 2
    assert capsys.readouterr().err == f"surgsim: circle/mink: {line}\n"


def test_a_start_is_measured_without_its_recording(small):
    done = small("bench", "--only", "startup", "--json")
    assert done.stderr.startswith("surgsim: left out: startup, its recording: recordings need rerun-sdk: pip")
    assert '"run"' in done.stdout
    assert '"recording"' not in done.stdout


def test_python_says_the_same(without, monkeypatch):
    task = {"duration_s": 0.2, "ramp_s": 0.1, "hold_start_s": 0.0, "hold_end_s": 0.0}
    run = surgsim.run("circle_lwr4plus", task=task, theatre=False)
    without("matplotlib", "dm_control", "rerun")
    with pytest.raises(MissingPackageError, match=r"^figures need matplotlib: pip install surgsim$"):
        run.figure()
    with pytest.raises(MissingPackageError, match=r"^learning environments need dm-control: pip install"):
        surgsim.env.load  # noqa: B018
    instead = r"^recordings need rerun-sdk: pip install surgsim, or record=False$"
    with pytest.raises(MissingPackageError, match=instead):
        surgsim.run("circle_lwr4plus", out="x")


def test_an_import_that_fails_deeper_down_is_a_line_too(monkeypatch, capsys):
    def fail(options):
        raise ModuleNotFoundError("No module named 'rerun.chunk'", name=failing)

    monkeypatch.setattr("surgsim.cli.list.execute", fail)
    failing = "rerun.chunk"
    assert main(["list", "scenarios"]) == 2
    assert capsys.readouterr().err == "surgsim: this needs rerun-sdk: pip install surgsim\n"
    failing = "theirs"
    assert missing(ModuleNotFoundError(name=failing)) is None
    with pytest.raises(ModuleNotFoundError):
        main(["list", "scenarios"])
