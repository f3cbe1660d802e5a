"""Pictures of the scenes: drawn where that is possible, a schematic where not, and nothing lost otherwise."""

import base64
import io
import json
import re
import subprocess
from dataclasses import replace

import pytest
from PIL import Image

from surgsim.errors import SurgsimError
from surgsim.models.build import build
from surgsim.models.picture import render
from surgsim.report import scenes
from surgsim.report.figures.schematic import schematic
from surgsim.report.results import read_results
from surgsim.report.scene_process import main
from surgsim.report.write import write_report
from surgsim.scenario.load import load_scenario
from surgsim.simulate.setup import prepare

SCENE = {
    "scenario": "circle_lwr4plus",
    "robot": "lwr4plus",
    "base": [0, 0, 0],
    "joints": [[0, 0, 0.3], [0, 0.4, 0.5]],
    "tip": [0, 0.55, 0],
    "trocar": None,
    "path": [],
    "picture": "abc",
}


@pytest.fixture(scope="module")
def shown():
    """Scenes as the process works them out, without pictures."""
    names = ["no_such_scenario", "circle_lwr4plus", "spiral_lwr4plus", "circle_panda"]
    return main({"scenarios": names, "draw": False})


def test_the_first_scenario_of_each_arm_is_shown(shown):
    assert [(scene["scenario"], scene["robot"]) for scene in shown] == [
        ("circle_lwr4plus", "lwr4plus"),
        ("circle_panda", "panda"),
    ]
    assert all(len(scene["joints"]) == 7 and len(scene["path"]) > 10 for scene in shown)
    assert all(scene["picture"] is None for scene in shown)


def test_a_schematic_shows_arm_port_and_tip(shown):
    drawn = schematic(scenes._view(shown[0]))
    assert re.findall(r"<text[^>]*>([^<]*)", drawn) == ["port", "tip", "lwr4plus"]
    places = [float(x) for x in re.findall(r"[ML](-?[\d.]+) ", drawn)]
    assert all(-10.0 <= x <= 370.0 for x in places)


def test_a_machine_without_opengl_gets_a_schematic_that_says_so(
    made_results, tmp_path, monkeypatch, scene_view
):
    monkeypatch.setattr(scenes, "look", lambda names: (scene_view(None),))
    text = write_report(made_results(), tmp_path / "page.html").read_text()
    assert "Schematic: this machine has no OpenGL to draw the scene." in text
    assert "<img" not in text


def test_scenarios_that_are_not_at_hand_leave_a_page_without_a_picture(made_results, tmp_path, monkeypatch):
    monkeypatch.setattr(scenes, "look", lambda names: ())
    text = write_report(made_results(), tmp_path / "page.html").read_text()
    assert '<div class="scenes">' not in text
    assert '<p class="lead">' in text


def ask(monkeypatch, answers):
    """Replace the process by one that gives these answers, in order; returns what it was asked."""
    given, asked = iter(answers), []

    def run(command, **keys):
        asked.append((json.loads(keys["input"])["draw"], keys["env"].get("MUJOCO_GL")))
        answer = next(given)
        if isinstance(answer, Exception):
            raise answer
        status, said = answer if isinstance(answer, tuple) else (0, answer)
        return subprocess.CompletedProcess(command, status, stdout=said.encode(), stderr=b"")

    monkeypatch.setattr("surgsim.resources.subprocess.run", run)
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    scenes.drawn.cache_clear()
    return asked


def test_drawing_is_tried_without_a_display_then_with_one_then_not_at_all(monkeypatch):
    lost = (-11, "")
    late = subprocess.TimeoutExpired("python", 120.0)
    asked = ask(monkeypatch, [lost, late])
    (found,) = scenes.drawn(("circle_lwr4plus",))
    assert asked == [(True, "egl"), (True, None)]
    assert (found.robot, found.picture) == ("lwr4plus", None)


@pytest.mark.parametrize("said", ["disable", "off", "0"])
def test_where_nothing_is_to_be_drawn_no_process_is_started(monkeypatch, said):
    asked = ask(monkeypatch, [])
    monkeypatch.setenv("MUJOCO_GL", said)
    (found,) = scenes.drawn(("circle_lwr4plus",))
    assert (found.robot, found.picture, asked) == ("lwr4plus", None, [])


def test_the_first_picture_is_taken_and_an_answer_that_is_none_is_done_without(monkeypatch):
    asked = ask(monkeypatch, [json.dumps([SCENE])])
    assert scenes.drawn(("circle_lwr4plus",))[0].picture == "abc"
    assert asked == [(True, "egl")]
    ask(monkeypatch, ["{", "3"])
    assert scenes.drawn(("no_such_scenario",)) == ()


def test_where_nothing_is_drawn_but_the_scene_is_told_nobody_is_asked_again(monkeypatch):
    bare = json.dumps([{**SCENE, "picture": None}])
    asked = ask(monkeypatch, [bare, bare])
    (found,) = scenes.drawn(("circle_lwr4plus",))
    assert (found.picture, asked) == (None, [(True, "egl"), (True, None)])
    asked = ask(monkeypatch, [bare, (-11, "")])
    assert scenes.drawn(("circle_lwr4plus",)) == (found,)
    assert asked == [(True, "egl"), (True, None)]


def test_a_scene_needs_neither_plant_nor_controller(monkeypatch):
    for part in ("build", "Controller"):
        monkeypatch.setattr(f"surgsim.simulate.setup.{part}", lambda *_, **__: pytest.fail("not needed"))
    (found,) = main({"scenarios": ["circle_lwr4plus"], "draw": False})
    setup_free = load_scenario("circle_lwr4plus")
    assert found["trocar"] == list(setup_free.trocar.position_m)


def test_a_run_s_own_scenario_is_preferred_to_the_shipped_one(made_results, monkeypatch):
    results = read_results(made_results())
    asked = []
    monkeypatch.setattr(scenes, "look", lambda names: asked.append(names) or ())
    folder = results.folder / next(row["folder"] for row in results.rows)
    (folder / "scenario.yaml").write_text("name: x")
    scenes.scenes_of(results)
    (folder / "scenario.yaml").unlink()
    scenes.scenes_of(replace(results))
    assert asked[0] == (str((folder / "scenario.yaml").resolve()), *results.runs.scenarios[1:])
    assert asked[1] == tuple(results.runs.scenarios)


def test_the_process_draws_a_picture():
    scenes.drawn.cache_clear()
    found = scenes.drawn(("circle_lwr4plus",))
    assert len(found[0].joints) == 7
    if found[0].picture is None:  # then this machine cannot draw at all
        scenario = load_scenario("circle_lwr4plus")
        with pytest.raises(SurgsimError, match="no OpenGL"):
            render(build(scenario.scene), prepare(scenario).q_start)
        return
    image = Image.open(io.BytesIO(base64.b64decode(found[0].picture)))
    assert image.size == (880, 560)
    assert len(set(image.convert("L").tobytes())) > 50
