"""What `make pictures` makes is that of the current figures: tables, pictures, pages of the leaderboard."""

import importlib
import re
import sys
from pathlib import Path

import pytest

from surgsim.api.available import available
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


@pytest.fixture
def runs(made):
    """The script that runs the scenarios of the gallery."""
    return importlib.import_module("gallery_runs")


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
        assert stamped(draw.HERE / file) == draw.moving_stamp(file), AGAIN


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


def test_every_scenario_of_the_gallery_has_picture_and_result_of_what_it_is_now(runs):
    assert runs.out_of_date() == [], AGAIN
    every = available("scenarios")
    assert list(runs.results()) == list(every)
    assert set(runs.HERE.glob("*.gif")) == {runs.picture(name) for name in every}
    assert sum(file.stat().st_size for file in runs.HERE.glob("*.gif")) < 4_000_000


def test_a_result_or_a_picture_of_another_scenario_is_found(runs, monkeypatch, tmp_path):
    held = runs.results()
    held["circle_panda"] = {**held["circle_panda"], "stamp": held["circle_fr3"]["stamp"]}
    monkeypatch.setattr(runs, "results", lambda: held)
    assert runs.out_of_date() == ["circle_panda"]
    del held["circle_panda"]
    assert runs.out_of_date() == ["circle_panda"]
    pictures = {"circle_fr3": tmp_path / "none.gif", "spiral_panda": runs.picture("spiral_lwr4plus")}
    usual = runs.picture
    monkeypatch.setattr(runs, "picture", lambda name: pictures.get(name) or usual(name))
    assert set(runs.out_of_date()) == {"circle_panda", "circle_fr3", "spiral_panda"}


def test_a_stamp_is_of_scenario_cameras_and_the_assets_of_its_own_arms(runs, monkeypatch):
    before = {name: runs.stamp(name) for name in ("circle_panda", "circle_fr3", "two_ports_panda")}
    assert len(set(before.values())) == 3

    def changed():
        return {name for name, told in before.items() if runs.stamp(name) != told}

    monkeypatch.setitem(runs.CAMERAS, "circle_fr3", ("overview", "endoscope"))
    assert changed() == {"circle_fr3"}
    usual = runs._assets()
    other = [(parts, told + "x" * ("panda" in parts)) for parts, told in usual]
    monkeypatch.setattr(runs, "_assets", lambda: other)
    assert changed() == set(before)
    monkeypatch.delitem(runs.CAMERAS, "circle_fr3")
    assert changed() == {"circle_panda", "two_ports_panda"}


@pytest.mark.parametrize("name", ["breathing_tracked_panda", "safety/tip_limit", "teleop_free_motion_panda"])
def test_a_result_of_the_gallery_is_what_the_run_gives(runs, name):
    told, found = runs.results()[name], runs.result(runs.run(name))
    assert found.pop("figures") == pytest.approx(told.pop("figures"), rel=1e-3, abs=1e-6)
    assert {"stamp": told["stamp"], **found} == told


def test_a_scenario_that_ends_early_is_shown_with_what_ends_it(runs):
    held = runs.results()
    early = [name for name in held if name.startswith("safety/")]
    assert [held[name]["outcome"] for name in early] == [name.removeprefix("safety/") for name in early]
    assert all(held[name]["outcome"] == "completed" for name in set(held) - set(early))


def test_a_result_in_words(made):
    gallery = importlib.import_module("gallery")
    found = {
        "outcome": "completed",
        "t_s": 11.0,
        "detail": "",
        "success": True,
        "reason": "the path was followed",
        "exceeded": [],
        "figures": {"rcm_error_max_mm": 1.2345, "tip_error_max_mm": 0.0004},
    }
    path = "**Done** in 11 s: the path was followed"
    assert gallery.result(found) == f"{path}. RCM max 1.23 mm, tip max below 0.001 mm."
    past = {**found, "exceeded": ["`rcm_error_max_mm` 5.69 exceeds 5"], "figures": {}}
    assert gallery.result(past) == f"{path}, but `rcm_error_max_mm` 5.69 exceeds 5."
    assert gallery.result({**past, "success": False, "reason": "2 of 3"}) == "**Not done** in 11 s: 2 of 3."
    figures = {"delivered_excess_j": 0.25, "rings_transferred": 2.0}
    assert gallery.result({**found, "figures": figures}).endswith(
        ". 2 rings transferred, not passive: 0.25 J more than was stored."
    )
    assert gallery.result({**found, "figures": {"delivered_excess_j": -0.1}}).endswith(". passive.")
    arms = {"left_rcm_error_max_mm": 1.0, "right_rcm_error_max_mm": 2.0, "right_tip_error_max_mm": 3.0}
    assert gallery.result({**found, "figures": arms}).endswith(
        ". left: RCM max 1 mm; right: RCM max 2 mm, tip max 3 mm."
    )
    stopped = {**found, "outcome": "tip_limit", "t_s": 1.047, "detail": "too far", "figures": {}}
    assert gallery.result(stopped) == "**Ends as `tip_limit`** at 1.05 s: too far."


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
