"""The examples run, and do what they say."""

import json
import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from surgsim.compiled import compiled
from surgsim.tasks.base import following
from surgsim.tick.blank import new_command, new_feedback

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"


@pytest.fixture
def started(monkeypatch, tmp_path, capsys):
    """Start an example in an empty folder, as Python starts it; what it printed."""
    monkeypatch.chdir(tmp_path)

    def start(name, *words):
        monkeypatch.setattr(sys, "argv", [name, *words])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out

    return start


def test_the_sweep_prints_a_table_in_which_errors_grow_with_the_payload(started):
    table = [line.split() for line in started("parameter_sweep.py").splitlines()[1:]]
    values = np.array(table, dtype=float)
    assert values.shape == (4, 4)
    assert (np.diff(values, axis=0) > 0.0).all()


def test_the_figure_is_a_file_of_the_form_that_was_asked_for(started, tmp_path):
    assert "wrote rcm_error.svg" in started("paper_figure.py", "rcm_error.svg")
    assert (tmp_path / "rcm_error.svg").read_text(encoding="utf-8").startswith("<?xml")


def test_a_policy_is_trained_kept_and_run(started, tmp_path, monkeypatch):
    from surgsim.control.policies import registry

    monkeypatch.setattr(registry, "_registered", {})
    told = started("train_policy.py", "--generations", "1")
    rewards = re.search(r"reward ([\d.]+), best ([\d.]+)", told)
    assert 0.0 < float(rewards[1]) < float(rewards[2]) < 1.0
    assert len(json.loads((tmp_path / "policy.json").read_text(encoding="utf-8"))) == 4
    assert re.search(r"^trained: tip error [\d.]+ mm", told, re.MULTILINE)


def test_the_path_of_the_package_is_the_same_in_python_and_compiled(monkeypatch):
    module = runpy.run_path(str(EXAMPLES / "package" / "lab_parts.py"))
    config = module["LissajousConfig"]()
    task = config.build(np.array([0.0, 0.55, 0.02]))
    path = module["lissajous_path"]
    ours, theirs, told = new_command(), new_command(), new_feedback()
    fast, memory = following(compiled(path)), np.zeros(0)
    for told.t_s in np.linspace(0.0, task.duration_s, 50):
        config.kernel(task.gains, told, memory, ours)
        fast(task.gains, told, memory, theirs)
        for name in ("p_WTd", "v_WTd", "a_WTd"):
            np.testing.assert_array_equal(ours[name], theirs[name])
    assert np.ptp([task.command(t).p_WTd[0] for t in np.linspace(0.0, 10.0, 500)]) == pytest.approx(
        0.03, rel=1e-3
    )


def test_the_page_names_every_example():
    page = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    names = {path.name for path in EXAMPLES.glob("*.py")} | {
        f"{path.name}/" for path in EXAMPLES.iterdir() if path.is_dir()
    }
    named = set(re.findall(r"^\| \[([^]]+)\]", page, re.MULTILINE))
    assert named == {name for name in names if not name.startswith("__")}
