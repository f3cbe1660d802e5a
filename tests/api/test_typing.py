"""A type checker sees the public interface of an installed surgsim."""

import os
import subprocess
import sys
from pathlib import Path

import surgsim

ROOT = Path(surgsim.__file__).parents[1]
GOOD = """
from pathlib import Path
import surgsim

run: surgsim.Run = surgsim.run("circle_lwr4plus", controller=Path("mine.yaml"), task={"turns": 2}, seed=3)
error: float | None = run.metrics["tip_error_rms_mm"]
largest = float(run.trace["rcm_error_m"].max())
scenario: surgsim.Scenario = surgsim.load({"name": "x"})
found: surgsim.Comparison = surgsim.compare(["circle_lwr4plus"], seeds=range(3))
page: Path = found.report()
name: str = found.leaderboard()[0].controller
reveal_type(surgsim.read("runs"))
reveal_type(run.outcome)
"""
BAD = """
import surgsim

surgsim.run("circle_lwr4plus", seed="three")
surgsim.run("circle_lwr4plus").metric
surgsim.compare(3)
surgsim.nothing
"""


def mypy(tmp_path, text):
    file = tmp_path / "script.py"
    file.write_text(text)
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--no-error-summary"]
    command += ["--cache-dir", str(tmp_path / "cache"), "--config-file", os.devnull, str(file)]
    environment = {**os.environ, "MYPYPATH": str(ROOT)}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    return done.returncode, done.stdout.replace(f"{file}:", "").replace("script.py:", "").splitlines()


def test_a_script_that_is_right_passes_and_one_that_is_wrong_does_not(tmp_path):
    status, lines = mypy(tmp_path, GOOD)
    assert status == 0, lines
    assert 'Revealed type is "surgsim.api.run.Run | surgsim.api.comparison.Comparison"' in lines[0]
    assert 'Revealed type is "str"' in lines[1]
    status, lines = mypy(tmp_path, BAD)
    assert status == 1
    assert [line.rpartition("[")[2] for line in lines if "error" in line] == [
        "arg-type]",
        "attr-defined]",
        "arg-type]",
        "attr-defined]",
    ]
