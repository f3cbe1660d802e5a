"""Tables for papers: the leaderboard's figures, escaped, and in full for programs."""

import csv
import re

import numpy as np
import pytest

from surgsim.compare.leaderboard import leaderboard
from surgsim.compare.table import read_table
from surgsim.export.paper_table import PaperColumn, PaperTable, comma_separated, markdown, tex, tex_text
from surgsim.metrics.catalog import METRICS

METRIC = "rcm_error_rms_mm"


def rows_of(file):
    with file.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_a_batch_has_the_leaderboards_rows_with_median_and_p95(made_results, told, tmp_path):
    root, file = made_results(), tmp_path / "controllers.csv"
    assert told(root, "--table", file, "--metric", f"{METRIC},tip_error_rms_mm")[0] == 0
    table = read_table(root)
    wanted = leaderboard(table, METRIC)
    found = rows_of(file)
    assert [row["controller"] for row in found] == [row.controller for row in wanted]
    assert any(row.failed for row in wanted)  # else the next lines would check nothing
    for row, board in zip(found, wanted, strict=True):
        assert (int(row["runs"]), int(row["failed"]), int(row["place"])) == (
            board.runs,
            board.failed,
            board.place,
        )
        assert float(row[f"{METRIC}_iqm"]) == board.value.value
        runs = [
            run[METRIC]
            for run in table.rows()
            if run["controller"] == board.controller and run["outcome"] == "completed"
        ]
        values = np.sort([value for value in runs if value is not None])
        place = 0.95 * (len(values) - 1)  # linear between order statistics
        low = int(place)
        p95 = values[low] + (place - low) * (values[min(low + 1, len(values) - 1)] - values[low])
        assert float(row[f"{METRIC}_p95"]) == pytest.approx(p95, rel=1e-12)
        middle = (values[(len(values) - 1) // 2] + values[len(values) // 2]) / 2
        assert float(row[f"{METRIC}_median"]) == pytest.approx(middle, rel=1e-12)


def test_the_other_metrics_follow_the_rows_of_the_first(made_results, told, tmp_path):
    root, file = made_results(), tmp_path / "controllers.csv"
    other = "tip_error_rms_mm"
    assert told(root, "--table", file, "--metric", f"{METRIC},{other}")[0] == 0
    table = read_table(root)
    by_name = {row.controller: row.value.value for row in leaderboard(table, other, places=False)}
    assert {row["controller"]: float(row[f"{other}_iqm"]) for row in rows_of(file)} == by_name


def test_tex_of_a_batch_with_awkward_names(made_results, told, tmp_path):
    file = tmp_path / "controllers.tex"
    assert told(made_results(awkward=True), "--table", file)[0] == 0
    lines = file.read_text(encoding="utf-8").splitlines()
    (begin,) = [line for line in lines if line.startswith(r"\begin{tabular}")]
    width = len(re.fullmatch(r"\\begin\{tabular\}\{([lr]+)\}", begin)[1])
    assert [line for line in lines if line in (r"\toprule", r"\midrule", r"\bottomrule")] == [
        r"\toprule",
        r"\midrule",
        r"\bottomrule",
    ]
    body = lines[lines.index(r"\midrule") + 1 : lines.index(r"\bottomrule")]
    assert body
    for line in body:
        assert line.endswith(r" \\")
        assert len(re.findall(r"(?<!\\)&", line)) == width - 1
        assert not re.search(r"(?<!\\)[%#_]", line)
    grouped = lines[lines.index(r"\toprule") + 1]
    spans = sum(int(span) for span in re.findall(r"multicolumn\{(\d)\}", grouped))
    assert len(re.findall(r"(?<!\\)&", grouped)) + spans - grouped.count("multicolumn") == width - 1


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("joint_impedance", r"joint\_impedance"),
        ("50 % & more #1 $x$ {y} a\\b ~ ^", r"50 \% \& more \#1 \$x\$ \{y\} a\textbackslash{}b "
         r"\textasciitilde{} \textasciicircum{}"),
        ("3.71e-5", r"$3.71\times10^{-5}$"),
        ("−1.20e-05", r"$-1.20\times10^{-5}$"),
        ("1.0e+06", r"$1.0\times10^{6}$"),
        ("−0.5", "$-$0.5"),
        ("manipulability [m³]", "manipulability [m$^3$]"),
        ("–", "--"),
    ],
)  # fmt: skip
def test_what_tex_would_take_for_something_else(text, shown):
    assert tex_text(text) == shown


def test_a_row_that_starts_with_a_bracket_is_no_option_of_the_line_before():
    column = PaperColumn(heading="x", texts=["a", "[b]", "*"], cells={"x": ["a", "[b]", "*"]}, right=False)
    assert "{}[b] \\\\\n{}* \\\\\n" in tex(PaperTable(columns=[column]))


def test_every_metric_has_a_heading_that_tex_shows():
    text = "".join(tex_text(metric.heading) for metric in METRICS.values())
    assert text.isascii()


def test_markdown_breaks_no_number_and_csv_rounds_none():
    name = PaperColumn(heading="name", texts=["a|b"], cells={"name": ["a|b"]}, right=False)
    value = PaperColumn(
        heading="IQM", group="error [mm]", texts=["0.1 [0.05, 0.2]"], cells={"low": [1 / 3], "high": [None]}
    )
    table = PaperTable(columns=[name, value], note="A note.")
    assert markdown(table) == (
        "| name | error [mm]: IQM |\n|---|---:|\n| a\\|b | 0.1\xa0[0.05,\xa00.2] |\n\nA note.\n"
    )
    assert comma_separated(table) == f"name,low,high\na|b,{1 / 3!r},\n"


def test_a_run_has_a_row_for_each_metric_and_runs_have_one_each(run, run_folder, unrecorded, told, tmp_path):
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"
    assert told(run_folder, "--table", one)[0] == 0
    defined = {name: value for name, value in run.metrics.items() if value is not None}
    assert {row["metric"]: float(row["value"]) for row in rows_of(one)} == defined
    assert told(run_folder, unrecorded, "--table", two, "--metric", METRIC)[0] == 0
    found = rows_of(two)
    assert [(row["controller"], row["seed"]) for row in found] == [("pinv", "3"), ("pinv", "0")]
    assert float(found[0][METRIC]) == run.metrics[METRIC]


def test_a_study(told, tmp_path, request):
    folder, file = request.config.rootpath / "results" / "vprnn", tmp_path / "comparison.csv"
    assert told(folder, "--table", file, "--table", tmp_path / "comparison.md")[0] == 0
    found = rows_of(file)
    given = rows_of(folder / "comparison.csv")
    assert [row["controller"] for row in found] == [row["controller"] for row in given]
    assert [float(row["rcm_rms_mm"]) for row in found] == [float(row["rcm_rms_mm"]) for row in given]


def test_what_makes_no_table(run_folder, made_results, told, tmp_path):
    out = ("--table", tmp_path / "x.md")
    assert told(run_folder, made_results(), *out) == (
        2,
        "surgsim: --table is of runs, or of one batch or one study: give these alone\n",
    )
    status, error = told(run_folder, *out, "--metric", "rcm_error_rsm_mm")
    assert status == 2
    assert error.startswith("surgsim: 'rcm_error_rsm_mm' is not a metric. Known: ")
    assert list(tmp_path.iterdir()) == []


def test_columns_of_a_study_beside_the_names_of_its_rows(told, tmp_path, request):
    folder, file = request.config.rootpath / "results" / "vprnn", tmp_path / "x.csv"
    assert told(folder, "--metric", "rcm_max_mm,outcome", "--table", file)[0] == 0
    head = file.read_text(encoding="utf-8").splitlines()[0]
    assert head == "level,controller,rcm_max_mm,outcome"
    status, error = told(folder, "--metric", "rcm_maximum", "--table", tmp_path / "y.csv")
    assert status == 2
    assert error.startswith("surgsim: --metric: 'rcm_maximum' is not a column of this table.")
