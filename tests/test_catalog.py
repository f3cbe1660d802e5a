import os
import re
import subprocess
import sys

import pytest
from pydantic import TypeAdapter, ValidationError

from surgsim.catalog import Catalog, Name
from surgsim.errors import SurgsimError
from surgsim.plugins import Offer
from surgsim.scenario.load import load_scenario
from surgsim.tasks import TASKS
from surgsim.tasks.circle import CircleConfig


def _catalog(place: str) -> Catalog:
    return Catalog("widget", "surgsim.no_such_group", {"part": place})


def _offers(**places: str) -> dict[str, Offer]:
    return {
        name: Offer(group="a group", name=name, place=place, package="lab", version="1.0")
        for name, place in places.items()
    }


def test_a_name_gives_its_config_class():
    assert TASKS.config("circle") is CircleConfig
    assert TASKS.names() == sorted(TASKS.names())


def test_an_unknown_name_is_refused_with_the_known_ones_and_a_hint():
    text = f"'circel' is not a task. Known: {', '.join(TASKS.names())}. Did you mean 'circle'?"
    with pytest.raises(SurgsimError, match=re.escape(text)):
        TASKS.config("circel")


@pytest.mark.parametrize("place", ["surgsim.nowhere:Config", "surgsim.tasks.circle:Nothing"])
def test_a_part_that_does_not_load_is_the_user_s_to_mend(place):
    with pytest.raises(SurgsimError, match="widget 'part' does not load"):
        _catalog(place).config("part")


@pytest.mark.parametrize("place", ["surgsim.errors:SurgsimError", "math:pi"])
def test_a_part_must_be_a_config(place):
    with pytest.raises(SurgsimError, match=re.escape(f"widget 'part' ({place}) is not a PartConfig class")):
        _catalog(place).config("part")


def test_parts_of_other_packages_come_from_entry_points_and_cannot_hide_ours(monkeypatch):
    given = _offers(theirs="surgsim.tasks.circle:CircleConfig", part="somewhere:Else")
    monkeypatch.setattr("surgsim.catalog.offers", lambda group: given)
    catalog = _catalog("surgsim.tasks.spiral:SpiralConfig")
    assert catalog.names() == ["part", "theirs"]
    assert catalog.config("theirs") is CircleConfig
    assert catalog.config("part").__name__ == "SpiralConfig"


@pytest.fixture
def foreign(monkeypatch):
    """A catalog with one part of ours and foreign ones at the given places."""

    def make(**places):
        monkeypatch.setattr("surgsim.catalog.offers", lambda group: _offers(**places))
        return Catalog("widget", "a group", {"circle": "surgsim.tasks.circle:CircleConfig"})

    return make


BROKEN = {
    "no module": ("nowhere_at_all:Config", "No module named 'nowhere_at_all'"),
    "no class": ("surgsim.tasks.circle:Nothing", "has no attribute 'Nothing'"),
    "an error while it is imported": ("broken_part:Config", "ZeroDivisionError: division by zero"),
    "no config": ("math:pi", "widget 'theirs' of the package lab 1.0 (math:pi) is not a PartConfig class"),
    "another type": ("surgsim.tasks.circle:CircleConfig", "needs the field type: Literal['theirs']"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_foreign_part_that_does_not_load_stops_only_what_names_it(
    foreign, tmp_path, monkeypatch, capsys, name
):
    (tmp_path / "broken_part.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(tmp_path)
    place, reason = BROKEN[name]
    catalog = foreign(theirs=place)
    adapter = TypeAdapter(catalog.union())
    for _ in range(2):
        assert catalog.names() == ["circle", "theirs"]
        assert reason in catalog.summary("theirs")
    out, error = capsys.readouterr()
    assert out == ""
    assert error.startswith("surgsim: widget 'theirs' of the package lab 1.0 ")
    assert error.endswith("; no scenario can name it\n")
    assert error.count("\n") == 1, "it is said once"
    assert reason in error
    assert adapter.validate_python({"type": "circle"}) == CircleConfig()
    with pytest.raises(ValidationError) as refused:
        adapter.validate_python({"type": "theirs", "gain": 3.0})
    assert refused.value.error_count() == 1
    assert reason in str(refused.value)


def test_one_of_ours_that_does_not_load_is_an_error():
    with pytest.raises(SurgsimError, match="widget 'part' does not load"):
        _catalog("surgsim.nowhere:Config").union()


def test_a_scenario_that_names_a_broken_part_is_refused_and_others_run(tmp_path):
    """In a process of its own, with a package whose entry point leads nowhere."""
    package = tmp_path / "theirs-1.0.dist-info"
    package.mkdir()
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n")
    (package / "entry_points.txt").write_text("[surgsim.resolvers]\nbroken = nowhere_at_all:Config\n")
    paths = os.pathsep.join([str(tmp_path), *sys.path])

    def check(*words):
        command = [sys.executable, "-W", "error", "-m", "surgsim", "check", "--quiet", *words]
        environment = {**os.environ, "PYTHONPATH": paths}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=100)
        done.stderr = re.sub(r"(?m)^compil(ing|ed) .*\n", "", done.stderr)  # said where kernels are new
        return done

    reason = (
        "surgsim: resolver 'broken' of the package theirs 1.0 does not load: No module named 'nowhere_at_all'"
    )
    fine = check("circle_lwr4plus")
    assert (fine.returncode, fine.stderr) == (0, f"{reason}; no scenario can name it\n")
    setting = "controller.resolver={type: broken, gain: 3}"
    refused = check("circle_lwr4plus", "--set", setting)
    assert refused.returncode == 2
    assert refused.stderr.splitlines() == [
        f"{reason}; no scenario can name it",
        f"surgsim: --set {setting}: controller.resolver: {reason.removeprefix('surgsim: ')}",
    ]


@pytest.mark.parametrize("name", ["../x", "a/b", "", "A", "a b", "x" * 65, "_x", ".x"])
def test_a_name_that_is_no_safe_file_name_is_refused(name):
    with pytest.raises(
        ValidationError, match="must be lower-case letters, digits and underscores, at most 64"
    ):
        TypeAdapter(Name).validate_python(name)


def test_a_controller_cannot_leave_the_results_folder():
    with pytest.raises(SurgsimError, match=re.escape("controller.name: '../x' must be lower-case letters")):
        load_scenario("circle_lwr4plus", assignments=["controller.name=../x"])


def test_summary_is_the_first_line_of_the_docstring():
    assert TASKS.summary("circle") == (CircleConfig.__doc__ or "").split("\n")[0]
