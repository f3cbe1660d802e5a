"""Figures that a journal takes: width, letters, colours, and what is drawn."""

import re

import numpy as np
import pytest
from matplotlib import rcParams
from PIL import Image

from surgsim.errors import SurgsimError
from surgsim.export import figure as drawing
from surgsim.export.figure import _by_controller, _fitting, _over_time
from surgsim.export.paper_style import COLOURS, journal_style
from surgsim.export.study_figure import study_figure
from surgsim.export.subjects import find

OKABE_ITO = [
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#F0E442",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
]  # as published


def test_pdf_has_the_width_of_a_column_and_its_letters(run_folder, told, tmp_path):
    file = tmp_path / "run.pdf"
    assert told(run_folder, "--figure", file)[0] == 0
    content = file.read_bytes()
    left, _, right, _ = (float(x) for x in re.search(rb"/MediaBox \[ (.+?) \]", content)[1].split())
    assert right - left == pytest.approx(3.5 * 72)
    assert b"/FontFile2" in content
    assert b"/Type3" not in content
    assert b"STIXGeneral" in content
    assert b"CreationDate" not in content


def test_svg_and_png(run_folder, told, tmp_path):
    svg, png = tmp_path / "run.svg", tmp_path / "run.png"
    assert told(run_folder, "--figure", svg, "--figure", png, "--width", "page")[0] == 0
    text = svg.read_text(encoding="utf-8")
    assert float(re.search(r'width="([\d.]+)pt"', text)[1]) == pytest.approx(7.2 * 72)
    assert "<text" not in text
    assert "<dc:date>" not in text
    with Image.open(png) as image:
        assert image.size[0] == round(7.2 * 600)


def test_the_same_run_gives_the_same_bytes_whatever_was_set(run_folder, told, tmp_path, monkeypatch):
    def files(name):
        return [tmp_path / f"{name}.{suffix}" for suffix in ("pdf", "svg", "png")]

    def draw(name):
        assert told(run_folder, *(word for file in files(name) for word in ("--figure", file)))[0] == 0

    draw("a")
    monkeypatch.setitem(rcParams, "axes.facecolor", "red")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    draw("b")
    assert [file.read_bytes() for file in files("a")] == [file.read_bytes() for file in files("b")]
    assert rcParams["axes.facecolor"] == "red"


def test_the_colours_are_those_of_okabe_and_ito():
    assert {*COLOURS[:-1]} < {*OKABE_ITO}
    assert len({*COLOURS}) == 8


def test_lines_are_the_errors_and_the_limit_is_named(run):
    with journal_style():
        figure = _over_time([run], "column")
    for ax, column in zip(figure.axes, ("rcm_error_m", "tip_error_m"), strict=True):
        (line,) = [line for line in ax.get_lines() if line.get_label() != "limit"]
        times, shown = line.get_data()
        whole = 1e3 * run.trace[column]
        assert np.interp(run.trace["t_s"], times, shown) == pytest.approx(whole, abs=2e-3 * whole.max())
        assert shown.max() == pytest.approx(whole.max(), rel=1e-3)
    limit = 1e3 * run.trace.meta.scenario["safety"]["rcm_error_max_m"]
    assert figure.axes[0].get_title(loc="right") == f"limit {limit:g} mm"
    assert figure.legends == []


def test_several_runs_have_one_legend_off_the_data(run, run_folder, unrecorded, monkeypatch):
    with journal_style():
        figure = _over_time([run, find(str(run_folder / "recording.rrd"))], "page")
        figure.canvas.draw()
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["pinv (run)", "pinv (recording.rrd)"]
    box = legend.get_window_extent()
    assert not any(box.overlaps(ax.get_window_extent()) for ax in figure.axes)
    assert len({line.get_color() for line in figure.axes[0].get_lines()}) == 2


@pytest.mark.parametrize(
    ("lengths", "letters", "columns"), [((4, 20, 5), 60, 3), ((4, 20, 5), 45, 2), ((30, 30), 60, 1)]
)
def test_a_legend_takes_as_many_columns_as_fit(lengths, letters, columns):
    assert _fitting(["x" * length for length in lengths], letters) == columns


def test_boxes_of_a_batch_are_quartiles_and_failures_are_named(made_results):
    batch = find(str(made_results()))
    metric = "rcm_error_rms_mm"
    with journal_style():
        (ax,) = _by_controller(batch, [metric], "column").axes
    names = [label.get_text() for label in ax.get_yticklabels()]
    assert sorted(names) == sorted(batch.results.runs.controllers)
    medians = [line.get_xdata()[0] for line in ax.get_lines() if line.get_color() == "black"]
    failures = []
    for name, shown in zip(names, medians, strict=True):
        rows = [row for row in batch.results.rows if row["controller"] == name]
        values = [row[metric] for row in rows if row["outcome"] == "completed"]
        assert shown == pytest.approx(np.median([value for value in values if value is not None]))
        failures += [len(rows) - len(values)]
    assert any(failures)
    assert [text.get_text().split()[0] for text in ax.texts] == [str(count) for count in failures if count]


def test_what_makes_no_figure(run_folder, made_results, unrecorded, told, tmp_path):
    out = ("--figure", tmp_path / "x.pdf")
    assert told(run_folder, made_results(), *out)[1].startswith(
        "surgsim: --figure is of runs, or of one batch"
    )
    assert "a run without recording" in told(unrecorded, *out)[1]
    assert told(run_folder, "--figure", tmp_path / "x.jpg")[1].endswith("Allowed: .pdf, .png, .svg.\n")
    assert list(tmp_path.iterdir()) == []
    assert drawing.SUFFIXES == (".pdf", ".png", ".svg")


class Rows:
    """A study with these tables."""

    def __init__(self, **tables):
        self.path, self.tables, self._rows = "made", tuple(tables), tables

    def rows(self, table):
        name = table or self.tables[0]
        return name, self._rows[name]


def swept(places, kinds, repeats=1):
    """A table of an error over a delay, for each kind."""
    return [
        {"kind": kind, "seed": seed, "delay_ms": delay, "outcome": "completed", "error_mm": delay + k}
        for k, kind in enumerate(kinds)
        for seed in range(repeats)
        for delay in places
    ]


def study_axes(study, table=None, columns=()):
    with journal_style():
        return study_figure(study, table, columns, "column").get_axes()


def test_a_study_s_table_is_lines_over_what_was_varied():
    (ax,) = study_axes(Rows(sweep=swept((0, 100, 300), ("a", "b"))))
    assert [line.get_label() for line in ax.get_lines()] == ["a, seed 0", "b, seed 0"]
    np.testing.assert_array_equal(ax.get_lines()[1].get_xydata(), [[0, 1], [100, 101], [300, 301]])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("delay [ms]", "error [mm]")


def test_another_table_of_a_study_is_a_point_beside_each_row_s_name():
    rows = [{"path": "circle", "home": 1, "share": 0.5}, {"path": "circle", "home": 2, "share": None}]
    (ax,) = study_axes(Rows(homes=rows))
    assert [text.get_text() for text in ax.get_yticklabels()] == ["circle, home 1", "circle, home 2"]
    assert [len(line.get_xdata()) for line in ax.get_lines()] == [1, 0]


def test_a_table_that_is_too_long_for_a_figure_names_those_that_are_not():
    study = Rows(every=swept((0, 100, 300), "abcdefghi", 2), few=swept((0, 1, 2), "ab"))
    with pytest.raises(SurgsimError, match=r"'every' of made has 54 rows, more .* another: few$"):
        study_axes(study)
    assert study_axes(study, "few")
    with pytest.raises(SurgsimError, match=r"--metric: 'errors_mm' is not a column of numbers of this table"):
        study_axes(study, "few", ["errors_mm"])


def test_every_study_of_the_results_has_a_figure(told, tmp_path, request):
    tables = {
        "vprnn": "comparison",
        "bilateral_schemes": "schemes",
        "manipulability_validation": "table_4",
        "passive_teleoperation": "frontier",
    }
    for folder, table in tables.items():
        study = request.config.rootpath / "results" / folder
        file = tmp_path / f"{folder}.svg"
        assert told(study, "--study-table", table, "--figure", file) == (0, "")
        assert file.stat().st_size > 10_000


def test_what_no_axis_holds_is_told():
    mixed = [{"figure": "tip error (mm)", "paper": 1.0}, {"figure": "lowest tank (J)", "paper": 2.0}]
    few = swept((0, 1, 2), "ab")
    with pytest.raises(SurgsimError, match=r"'mixed' of made has rows of different units.* another: few$"):
        study_axes(Rows(mixed=mixed, few=few))
    with pytest.raises(SurgsimError, match=r"'words' of made has no column of numbers$"):
        study_axes(Rows(words=[{"claim": "a", "verdict": "holds"}, {"claim": "b", "verdict": "fails"}]))


def test_columns_with_a_unit_come_first():
    rows = [{"home": k, "pinv": 0.1, "pinv_off_percent": 2.0 + k} for k in range(3)]
    (ax,) = study_axes(Rows(homes=rows), columns=["pinv_off_percent"])
    assert ax.get_xlabel() == "pinv off [%]"
    assert study_axes(Rows(homes=rows))[0].get_xlabel() == "pinv off [%]"
