"""A run whose arm's file is gone is read as it was; it cannot be run again."""

import shutil
import subprocess
import sys

import pytest
from foreign_arms import write_urdf

from surgsim.cli.main import main
from surgsim.errors import SurgsimError
from surgsim.runs.folder import run_to_folder
from surgsim.scenario.load import load_scenario

CONTENT = {
    "name": "own_arm",
    "start": {"q_rad": [0.0, 0.5, 0.6, 0.4, 0.7, 0.2]},
    "task": {"type": "circle", "duration_s": 2.0, "radius_m": 0.01, "ramp_s": 0.5, "hold_end_s": 0.0},
    "controller": "joint_impedance",
    "theatre": False,
}


def test_a_run_whose_arm_is_gone_is_read_as_it_was(tmp_path, capsys):
    file = write_urdf(tmp_path)
    scenario = load_scenario({**CONTENT, "robot": {"urdf": str(file), "armature_kg_m2": [0.1] * 6}})
    run = tmp_path / "run"
    run_to_folder(scenario, run)
    assert load_scenario(run / "scenario.yaml").sha256() == scenario.sha256()
    before, told = main(["inspect", str(run)]), capsys.readouterr().out
    shutil.rmtree(file.parents[1])
    words = [sys.executable, "-m", "surgsim", "inspect", str(run)]  # a process that never saw the arm
    again = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert (again.returncode, again.stdout) == (before, told)
    assert "manipulability_optimality is as stored; it cannot be computed again here" in again.stderr
    with pytest.raises(SurgsimError, match=r"scenario.yaml:\d+: robot.urdf: .* cannot be read"):
        load_scenario(run / "scenario.yaml")
