import re

import pytest

from surgsim.catalog import Catalog
from surgsim.errors import SurgsimError
from surgsim.tasks import TASKS
from surgsim.tasks.circle import CircleConfig


def _catalog(place: str) -> Catalog:
    return Catalog("widget", "surgsim.no_such_group", {"part": place})


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
    class Point:
        def __init__(self, name: str, value: str) -> None:
            self.name, self.value = name, value

    points = [Point("theirs", "surgsim.tasks.circle:CircleConfig"), Point("part", "somewhere:Else")]
    monkeypatch.setattr("surgsim.catalog.entry_points", lambda group: points)
    catalog = _catalog("surgsim.tasks.spiral:SpiralConfig")
    assert catalog.names() == ["part", "theirs"]
    assert catalog.config("theirs") is CircleConfig
    assert catalog.config("part").__name__ == "SpiralConfig"


def test_summary_is_the_first_line_of_the_docstring():
    assert TASKS.summary("circle") == (CircleConfig.__doc__ or "").split("\n")[0]
