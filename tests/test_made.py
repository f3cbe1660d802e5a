"""What `make pictures` makes is that of the current figures: tables, pictures, pages of the leaderboard."""

import importlib
import re
import sys
from pathlib import Path

import pytest

from surgsim.compare.table import read_table
from surgsim.scenario.load import shipped

ROOT = Path(__file__).resolve().parents[1]
AGAIN = "run `make pictures`"
SUITES = sorted(path.parent.name for path in (ROOT / "results" / "leaderboard").glob("*/runs.csv"))


@pytest.fixture(scope="module")
def made():
    """The scripts of `docs/images`, which import one another by name."""
    sys.path.insert(0, str(ROOT / "docs" / "images"))
    try:
        yield importlib.import_module("draw"), importlib.import_module("tables")
    finally:
        sys.path.pop(0)


def stamped(path):
    """What a picture says that it was made from."""
    return importlib.import_module("stamps").stamped(path)


def test_the_tables_of_the_documents_are_those_of_the_results(made):
    _, tables = made
    found = set()
    for name in tables.PAGES:
        text = (ROOT / name).read_text(encoding="utf-8")
        assert tables.filled(text) == text, f"{name} holds other figures than results/leaderboard: {AGAIN}"
        found |= set(re.findall(r"<!-- table (\w+) -->", text))
    assert found == set(tables.TABLES)  # none is made for nothing, none has an unknown name


def test_a_wrong_figure_in_a_table_is_found(made):
    _, tables = made
    text = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    figure = re.search(r"<!-- table theatre_short -->.*?\| (0\.\d+) \|", text, re.DOTALL)
    assert figure
    wrong = text.replace(f"| {figure[1]} |", f"| {figure[1]}9 |")
    assert wrong != text
    assert tables.filled(wrong) == text


def test_the_reference_runs_are_as_many_as_their_page_says():
    text = (ROOT / "results" / "leaderboard" / "README.md").read_text(encoding="utf-8")
    told = dict(re.findall(r"^\| `(\w+)/` \| .*? \| (\d+) \|", text, re.M))
    held = {
        path.parent.name: str(len(read_table(path.parent)))
        for path in (ROOT / "results" / "leaderboard").glob("*/runs.csv")
    }
    assert told == held


def test_what_the_results_say_of_our_controller_holds_in_the_rows():
    text = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    said = re.search(r"same LWR4\+ scenarios: tip RMS at most ([\d.]+) mm, RCM max at most ([\d.]+) mm", text)
    rows = read_table(ROOT / "results/leaderboard/nominal").rows()
    ours = [r for r in rows if r["controller"] == "rcm_inverse_dynamics" and "lwr4plus" in r["scenario"]]
    assert max(r["tip_error_rms_mm"] for r in ours) <= float(said[1])
    assert max(r["rcm_error_max_mm"] for r in ours) <= float(said[2])


@pytest.mark.parametrize(
    "file",
    [
        "theatre.png",
        "port_closeup.png",
        "panda.png",
        "fr3.png",
        "iiwa14.png",
        "two_ports.png",
    ],
)
def test_the_pictures_are_those_of_the_current_scenes(made, file):
    draw, _ = made
    assert stamped(draw.HERE / file) == draw.scene_stamp(*draw.SCENES[file]), AGAIN


def test_the_moving_pictures_are_of_the_current_scenes(made):
    draw, _ = made
    for file in draw.MOVING:
        assert draw.moving_stamp(file).encode() in (draw.HERE / file).read_bytes(), AGAIN


def test_the_picture_of_the_theatres_errors_is_that_of_the_results(made):
    draw, _ = made
    assert stamped(draw.HERE / "theatre_errors.png") == draw.errors_stamp(), AGAIN


def test_the_picture_of_peg_and_ring_is_that_of_the_results(made):
    draw, _ = made
    assert stamped(draw.HERE / "peg_and_ring.png") == draw.peg_and_ring_stamp(), AGAIN


def test_the_diagrams_are_those_of_their_script(made):
    concepts = importlib.import_module("concepts")
    for file in concepts.DIAGRAMS:
        assert stamped(concepts.HERE / file) == concepts.stamp(), AGAIN


def test_the_gallery_shows_the_current_scenarios(made):
    gallery = importlib.import_module("gallery")
    text = gallery.PAGE.read_text(encoding="utf-8")
    assert text == gallery.page(), AGAIN
    assert [name for name in shipped() if f"surgsim run {name}" not in text] == []


def test_the_picture_of_the_paths_is_that_of_the_current_paths(made):
    draw, _ = made
    assert stamped(draw.HERE / "paths.png") == draw.paths_stamp(), AGAIN


@pytest.mark.parametrize("suite", SUITES)
def test_the_pages_of_the_leaderboard_say_what_their_rows_say(suite):
    from surgsim.compare.leaderboard import leaderboard
    from surgsim.compare.summary import summary
    from surgsim.report import html
    from surgsim.report.results import read_results

    results = read_results(ROOT / "results" / "leaderboard" / suite)
    metric = results.headline[0]
    told = summary(results.runs, metric, leaderboard(results.runs, metric))
    page = (results.folder / "report.html").read_text(encoding="utf-8")
    assert html.paragraph(told.first, "lead") in page, AGAIN
    assert all(f" {html.escape(one.text)}.</li>" in page for one in told.failing), AGAIN


@pytest.mark.parametrize("controller", ["constraint_consistent", "projected_jacobian"])
def test_a_row_of_the_torque_level_tables_is_what_the_run_gives(made, controller):
    page = (ROOT / "docs" / "controllers" / "constraint_consistent.md").read_text(encoding="utf-8")
    level = importlib.import_module("torque_level")
    for name in level.TABLES:
        assert page.count(f"<!-- made {name} -->") == 1
    found = level.measure(level.Job(scenario="rcm_spiral_panda", controller=controller))
    cells = [found["outcome"], *level.cells(found, level.COLUMNS)]
    shown = page.split("<!-- made settings_panda -->")[1].split("<!-- end -->")[0]
    assert f"| spiral | `{controller}` | {' | '.join(cells)} |" in shown
