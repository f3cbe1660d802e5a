"""The tutorial's notebooks run from top to bottom, as the scripts that they are kept as."""

import itertools
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "tutorial").glob("*.py"))


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(notebook, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    exec(compile(notebook.read_text(encoding="utf-8"), str(notebook), "exec"), {"__name__": "__main__"})
    assert capfd.readouterr().out


def test_each_notebook_names_the_next_one():
    found = {path.name: path.read_text(encoding="utf-8") for path in NOTEBOOKS}
    order = sorted(found, key=lambda name: re.search(r"^# # (\d) ", found[name], re.M)[1])
    assert len(order) == 4
    for name, following in itertools.pairwise(order):
        assert f"]({following})" in found[name]
