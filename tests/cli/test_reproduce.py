"""`surgsim reproduce`: a study's folder, what is printed, and what is refused."""

import json
import subprocess
import sys
from dataclasses import dataclass

import pytest

from surgsim import studies
from surgsim.cli.main import main
from surgsim.studies.study import Case, Claim, Measured, Paper, Study

NAME = "manipulability_validation"


@dataclass(frozen=True)
class _Row(Case):
    """A case of no work at all."""

    quick: bool
    fails: bool = False

    @property
    def label(self):
        return "working"

    def measured(self):
        if self.fails:
            raise RuntimeError("no")
        row = {"path": "circle", "home": 1, "mu": 0.1234567890123, "off_percent": -0.12345, "note": None}
        return Measured(case=self, row={**row, "quick": str(self.quick)})


def _small_study(fails=()):
    return Study(
        name="small",
        heading="Small",
        introduction="    {command}",
        quick_note="the same",
        paper=Paper(title="", printed={}),
        cases=lambda quick: {"table": [_Row(quick, fails=flag) for flag in (False, *fails)]},
        tables={"table": lambda results: results.rows("table", "path", "home", "mu", "off_percent", "note")},
        claims=[Claim("paper", "it is so", lambda tables: ("depends", f"{len(tables['table'])} row"))],
        sections=[],
        figures=[],
    )


@pytest.fixture
def small(monkeypatch, tmp_path):
    """A study of no work at all, run in an empty folder."""
    module = type(sys)("small_study")
    module.STUDY = _small_study()
    monkeypatch.setitem(sys.modules, "small_study", module)
    monkeypatch.setitem(studies.STUDIES, "small", "small_study")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_quick_through_the_installed_command(tmp_path):
    command = [sys.executable, "-W", "error", "-m", "surgsim", "reproduce", NAME, "--quick"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr
    assert done.stderr.startswith("1 of 11: circle, home 3: pinv, paper timing\n")
    assert done.stderr.endswith(f"wrote results/{NAME}_quick\n")
    lines = [line.split() for line in done.stdout.splitlines()]
    assert ["circle", "3", "0.02460", "0.02460", "-0.01", "0.02641", "0.02640", "0.03"] in lines
    assert "does not hold  the network reaches the largest mu (paper, section 3.2)\n" in done.stdout
    page = (tmp_path / "results" / f"{NAME}_quick" / "README.md").read_text()
    assert f"surgsim reproduce {NAME} --quick\n" in page


def test_table_and_claims_on_stdout_progress_on_stderr(small, capsys):
    assert main(["reproduce", "small"]) == 0
    out, error = capsys.readouterr()
    assert error == "1 of 1: working\nfigures\nwrote results/small\n"
    assert "0.1235" in out
    assert "-0.12" in out
    assert out.endswith("depends        it is so (paper)\n               1 row\n")
    table = (small / "results" / "small" / "table.csv").read_text()
    assert table == "path,home,mu,off_percent,note\ncircle,1,0.123456789,-0.12345,\n"


def test_json(small, capsys):
    assert main(["reproduce", "small", "--quick", "--json", "--out", "here"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["study"] == "small"
    assert printed["claims"] == [
        {"source": "paper", "text": "it is so", "verdict": "depends", "evidence": "1 row"}
    ]
    assert printed["tables"]["table"][0]["home"] == 1
    assert sorted(path.name for path in (small / "here").iterdir()) == sorted(printed["files"])


def test_a_study_replaces_its_own_folder_and_no_other(small, capsys):
    assert main(["reproduce", "small", "--out", "here"]) == 0
    (small / "here" / "old.csv").write_text("")
    assert main(["reproduce", "small", "--out", "here"]) == 0
    assert not (small / "here" / "old.csv").exists()
    (small / "notes").mkdir()
    (small / "notes" / "README.md").write_text("mine")
    (small / "here" / "thesis.docx").write_text("mine")
    capsys.readouterr()
    for folder, name in (("notes", "README.md"), ("here", "thesis.docx")):
        assert main(["reproduce", "small", "--out", folder]) == 2
        out, error = capsys.readouterr()
        assert out == ""
        assert f"surgsim: {folder} holds '{name}', which is not a study's; choose another --out\n" in error
        assert (small / folder / name).read_text() == "mine"


def test_a_study_that_fails_leaves_what_is_measured_and_the_next_goes_on(small, monkeypatch, capsys):
    monkeypatch.setattr("surgsim.studies.engine.WORKERS", 1)
    whole = sys.modules["small_study"].STUDY
    sys.modules["small_study"].STUDY = _small_study(fails=[True])
    with pytest.raises(RuntimeError):
        main(["reproduce", "small"])
    assert [path.name for path in (small / "results").iterdir()] == [".small.cases"]
    capsys.readouterr()
    sys.modules["small_study"].STUDY = whole
    assert main(["reproduce", "small"]) == 0
    assert "1 of 1 cases are there from a run that was interrupted\n" in capsys.readouterr().err
    assert [path.name for path in (small / "results").iterdir()] == ["small"]


def test_an_unknown_study_is_one_line(small, capsys):
    assert main(["reproduce", "manipulability"]) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert error.startswith("surgsim: 'manipulability' is not a study. Known: bilateral_schemes, ")
    assert error.count("\n") == 1
