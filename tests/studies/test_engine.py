"""The shared engine: a small study of declared parts, its processes, what it keeps, and its verdicts."""

import json
import multiprocessing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from surgsim.studies import STUDIES, load_study
from surgsim.studies.engine import measure_cases, run_study
from surgsim.studies.kept import kept_until_whole, read_measured, write_measured
from surgsim.studies.measures import decay_rate, outcome, within_from_s
from surgsim.studies.processes import in_processes
from surgsim.studies.study import (
    Case,
    Claim,
    Figure,
    Measured,
    Paper,
    Printed,
    Results,
    Section,
    Study,
    holds,
    in_all,
)
from surgsim.studies.tables import groups, number, numbers, pick, read_csv, span

ROOM = Path(__file__).resolve().parents[2] / "surgsim" / "studies"
BOUND = Printed("figure 1", "m", 4.0)


@dataclass(frozen=True)
class Square(Case):
    """The square of a number; it notes that it was run."""

    value: int
    notes: str

    def measured(self):
        with Path(self.notes).open("a", encoding="utf-8") as file:
            file.write(f"{self.value}\n")
        if self.value < 0:
            raise ArithmeticError("no")
        row = {"value": self.value, "square_m": float(self.value**2), "note": None}
        return Measured(case=self, row=row, curves={"path": np.arange(self.value) / 3.0})


@dataclass(frozen=True)
class Alone(Square):
    """The same, with no other process beside it."""

    alone = True

    def measured(self):
        assert multiprocessing.parent_process() is None
        return super().measured()


def squares(notes, *values):
    return [Square(value, str(notes)) for value in values]


def ran(notes):
    return sorted(int(line) for line in notes.read_text().split()) if notes.exists() else []


def study_of(notes):
    """A study of squares with every part that a study can have."""

    def within(tables):
        rows = tables["squares"]
        flags = [number(row, "square_m") <= BOUND.value for row in rows]
        return in_all(flags), f"{sum(flags)} of {len(flags)}"

    def draw(axes, results, tables):
        for found in results["squares"]:
            axes[0, 0].plot(found.curves["path"], label=str(found.case.value))

    return Study(
        name="squares",
        heading="Squares",
        introduction='"{title}" ({reference}), made again by\n\n    {command}\n\nwith {versions}.',
        quick_note="one square",
        paper=Paper(title="On squares", reference="A. Author", printed={"bound": BOUND}),
        cases=lambda quick: {
            "squares": squares(notes, *((1,) if quick else (1, 2, 3))),
            "again": squares(notes, 1),
        },
        tables={
            "squares": lambda results: results.rows("squares", "value", "square_m"),
            "none": lambda results: results.rows("nothing"),
        },
        claims=[
            Claim(BOUND.source, "squares are small", within),
            Claim("surgsim", "there is nothing", lambda tables: None),
        ],
        sections=[
            Section("## All", "squares", ("squares.png",)),
            Section("## None", "none"),
            Section(lambda tables: f"{len(tables)} table", rows=({"what": "n", "here": "counted"},)),
        ],
        figures=[Figure("squares.png", "Squares", draw)],
    )


@pytest.fixture
def notes(tmp_path):
    return tmp_path / "notes"


@pytest.fixture
def out(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    return folder


def test_a_declaration_is_run_judged_drawn_and_written(notes, out):
    said = []
    result = run_study(study_of(notes), out, False, said.append)
    assert ran(notes) == [1, 2, 3]  # the case in two groups is run once
    assert result.files == ("README.md", "squares.csv", "squares.png")
    assert sorted(path.name for path in out.iterdir()) == sorted(result.files)
    assert read_csv(out / "squares.csv", float)[2] == {"value": 3.0, "square_m": 9.0}
    (finding,) = result.claims
    assert (finding.source, finding.verdict, finding.evidence) == ("paper, figure 1", "depends", "2 of 3")
    assert said[-1] == "figures"
    assert said[0] == f"1 of 3: Square: 1, {notes}"
    page = (out / "README.md").read_text()
    assert page.startswith(
        '# Squares\n\n"On squares" (A. Author), made again by\n\n    surgsim reproduce squares\n'
    )
    assert "| squares are small | paper, figure 1 | **depends** | 2 of 3 |" in page
    assert page.index("## All") < page.index("| 3 | 9.000 |") < page.index("![squares](squares.png)")
    assert "## None" not in page
    assert page.endswith("1 table\n\n| what | here |\n|---|---|\n| n | counted |\n")


def test_a_quick_study_has_fewer_cases_and_no_figures(notes, out):
    result = run_study(study_of(notes), out, True, lambda line: None)
    assert ran(notes) == [1]
    assert result.files == ("README.md", "squares.csv")
    page = (out / "README.md").read_text()
    assert "surgsim reproduce squares --quick\n" in page
    assert "This is a quick run: one square." in page
    assert ".png" not in page


def test_an_interrupted_study_goes_on_with_what_is_kept(notes, tmp_path):
    with pytest.raises(ArithmeticError), kept_until_whole(tmp_path / "out") as kept:
        measure_cases(squares(notes, 1, 2, -1, 3), lambda line: None, 1, kept)
    assert ran(notes) == [-1, 1, 2]
    notes.unlink()
    said = []
    with kept_until_whole(tmp_path / "out") as kept:
        found = measure_cases(squares(notes, 1, 2, 3), said.append, 1, kept)
    assert ran(notes) == [3]
    assert said == [
        "2 of 3 cases are there from a run that was interrupted",
        f"3 of 3: Square: 3, {notes}",
    ]
    assert not kept.exists()
    fresh = measure_cases(squares(notes, 1, 2, 3), lambda line: None, 1)
    for case, measured in fresh.items():
        assert found[case].row == measured.row
        np.testing.assert_array_equal(found[case].curves["path"], measured.curves["path"])


def test_what_is_kept_of_a_case_is_of_the_same_settings_sources_and_whole(notes, tmp_path, monkeypatch):
    (case, other) = squares(notes, 7, 8)
    write_measured(tmp_path, case.measured())
    assert read_measured(tmp_path, case).row == case.measured().row
    assert read_measured(tmp_path, other) is None
    monkeypatch.setattr("surgsim.studies.kept._sources", lambda module: "others")
    assert read_measured(tmp_path, case) is None
    monkeypatch.undo()
    (path,) = tmp_path.glob("*.npz")
    path.write_bytes(path.read_bytes()[:-40])
    assert read_measured(tmp_path, case) is None


def test_what_is_not_ours_is_not_removed_with_what_is_kept(notes, tmp_path):
    with kept_until_whole(tmp_path / "out") as kept:
        measure_cases(squares(notes, 1), lambda line: None, 1, kept)
        (kept / "thesis.docx").write_text("mine")
    assert [path.name for path in kept.iterdir()] == ["thesis.docx"]


def test_a_case_that_measures_time_is_run_last_in_this_process(notes):
    cases = [Alone(5, str(notes)), *squares(notes, 1, 2)]
    found = measure_cases(cases, lambda line: None, 1)
    assert [case.value for case in found] == [1, 2, 5]
    assert [int(line) for line in notes.read_text().split()] == [1, 2, 5]


def test_processes_give_every_value_in_order():
    assert list(in_processes(json.loads, ["3", "1", "2"], 2)) == [3, 1, 2]
    assert list(in_processes(json.loads, ["3"], 1)) == [3]
    assert multiprocessing.active_children() == []


def test_processes_end_when_one_fails():
    with pytest.raises(json.JSONDecodeError):
        list(in_processes(json.loads, ["3", "?", *(100 * ["1"])], 2))
    assert multiprocessing.active_children() == []


def test_results_of_a_group_and_of_a_case(notes):
    one, two = squares(notes, 1, 2)
    results = Results({"both": [one, two]}, {case: case.measured() for case in (one, two)})
    assert results.rows("both", "square_m") == [{"square_m": 1.0}, {"square_m": 4.0}]
    assert results.rows("other") == []
    assert results.of(two).row["value"] == 2
    assert two in results
    assert Square(3, "") not in results


def test_verdicts_of_yes_or_no_and_of_several():
    assert (holds(True), holds(False)) == ("holds", "does not hold")
    flags = ([True, True], [True, False], [False, False])
    assert [in_all(f) for f in flags] == ["holds", "depends", "does not hold"]


def test_tables_are_read_by_cells():
    rows = [{"a": 1, "b": "x", "c": 0.5}, {"a": 2, "b": "x", "c": None}, {"a": 1, "b": "y", "c": 2.0}]
    assert pick(rows, b="x", a=2) == [rows[1]]
    assert numbers(rows, "c") == [0.5, 2.0]
    assert groups(rows, "b") == {("x",): rows[:2], ("y",): rows[2:]}
    assert (span([0.12345, 2.0]), span([2.0, 2.0001])) == ("0.123 to 2", "2")
    with pytest.raises(TypeError, match="c is None, not a number"):
        number(rows[1], "c")


def test_convergence_time_counts_from_the_last_excursion():
    t = np.arange(5.0)
    assert within_from_s(t, np.array([3.0, 1.0, 2.0, 0.5, 0.1]), 1.0) == 3.0
    assert within_from_s(t, np.array([3.0, 1.0, 2.0, 0.5, 1.1]), 1.0) is None
    assert within_from_s(t, np.zeros(5), 1.0) == 0.0


def test_the_decay_rate_is_that_of_an_exponential():
    t = np.linspace(0.0, 3.0, 30001)
    assert decay_rate(t, 7.0 * np.exp(-2.5 * t), 0.05) == pytest.approx(2.5, rel=1e-4)
    assert decay_rate(t, np.ones_like(t), 0.05) is None


def test_the_outcome_is_the_name_of_the_ending(trace_of):
    assert outcome(trace_of(3)) == "completed"


@pytest.mark.parametrize("name", sorted(STUDIES))
def test_a_study_is_data_in_a_few_small_files(name):
    study = load_study(name)
    assert study.name == name
    files = list((ROOM / name).glob("*"))
    modules = [path for path in files if path.suffix == ".py"]
    assert [path.name for path in files if path not in modules and path.name != "__pycache__"] == []
    assert len(modules) <= 4
    for path in modules:
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 300, path


@pytest.mark.parametrize("name", sorted(STUDIES))
def test_what_the_page_shows_is_declared_once(name):
    study = load_study(name)
    shown = [file for section in study.sections for file in section.figures]
    assert sorted(shown) == sorted(figure.file for figure in study.figures)
    assert {section.table for section in study.sections} - {None} <= set(study.tables)
    texts = [(claim.source, claim.text) for claim in study.claims]
    assert len(set(texts)) == len(texts)
    full, quick = ({case for group in study.cases(flag).values() for case in group} for flag in (False, True))
    assert 0 < len(quick) < len(full)
    assert all(case.label for case in full)
