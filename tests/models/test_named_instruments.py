"""Instruments with a name: shipped ones, those on the search path, and those of packages."""

import shutil

import pytest
from angled import HOOK
from pydantic import ValidationError

from surgsim.contract import instruments
from surgsim.contract.check import BrokenPromiseError
from surgsim.errors import SurgsimError
from surgsim.models import instrument_files
from surgsim.models.config import InstrumentConfig
from surgsim.models.instrument_files import (
    GROUP,
    SEARCH_PATH,
    instrument_description,
    instrument_file,
    instrument_names,
)
from surgsim.plugins import Offer
from surgsim.scenario.load import load_scenario

SHIPPED = ["endoscope_0", "endoscope_30", "grasper", "hook_30"]
OPENINGS = ("Rigid laparoscope of", "Electrocautery hook", "Grasper with two hinged jaws")


def refused(**keys) -> str:
    with pytest.raises(ValidationError) as caught:
        InstrumentConfig(**keys)
    return caught.value.errors()[0]["msg"]


@pytest.fixture
def packaged(tmp_path, monkeypatch):
    """A package that offers the hook as `my_hook`, and an instrument that it has not; the hook's file."""
    package = f"lab_{tmp_path.name}"  # what is found of a package is remembered
    folder = tmp_path / package / "my_hook"
    folder.mkdir(parents=True)
    for place in (folder.parent, folder):
        (place / "__init__.py").write_text("")
    shutil.copy(HOOK, folder / "my_hook.xml")
    monkeypatch.syspath_prepend(tmp_path)
    found = {
        name: Offer(group=GROUP, name=name, place=f"{package}.{place}", package="lab", version="1")
        for name, place in {"my_hook": "my_hook", "lost": "no", "hook_30": "my_hook"}.items()
    }
    monkeypatch.setattr(instrument_files, "offers", lambda group: found if group == GROUP else {})
    return folder / "my_hook.xml"


def test_what_is_shipped_keeps_every_promise():
    assert instrument_names() == SHIPPED
    for name in SHIPPED:
        for check in instruments.CHECKS:
            check.run(name)
        assert instrument_description(name).startswith(OPENINGS)


def test_its_first_comment_describes_it_with_or_without_a_stop(tmp_path, monkeypatch):
    (tmp_path / "mine").mkdir()
    monkeypatch.setenv("SURGSIM_INSTRUMENTS", str(tmp_path))
    for comment, told in (("My hook", "My hook"), ("Mine. More", "Mine"), ("", "no description")):
        text = f'<mujoco><!-- {comment} --><worldbody><geom pos="0. 0 0" size="1"/></worldbody></mujoco>'
        (tmp_path / "mine" / "mine.xml").write_text(text, encoding="utf-8")
        assert instrument_description("mine") == told


def test_a_name_is_the_file_of_it():
    by_name, by_file = InstrumentConfig(name="hook_30"), InstrumentConfig(mjcf=str(HOOK))
    assert by_name.shaft_length_m == by_file.shaft_length_m
    assert (by_name.tool.p_ST == by_file.tool.p_ST).all()
    assert by_name.model_dump() == {"name": "hook_30", "shaft_diameter_m": 0.008}
    assert InstrumentConfig(**by_name.model_dump()) == by_name


def test_what_a_name_does_not_go_with_is_refused():
    assert "'hook_3' is not an instrument. Known: endoscope_0" in refused(name="hook_3")
    assert "A file is given as mjcf" in refused(name="hook_30.xml")
    assert "give one of name and mjcf" in refused(name="hook_30", mjcf=str(HOOK))
    assert "tip_site is for an instrument from a file: give mjcf" in refused(name="hook_30", tip_site="a")
    assert "mass_kg is read from the instrument's file" in refused(name="hook_30", mass_kg=1.0)
    assert "files_sha256 is for an instrument from a file" in refused(name="hook_30", files_sha256="0")


def test_a_package_offers_an_instrument(packaged):
    assert instrument_names() == [*SHIPPED, "lost", "my_hook"]
    assert instrument_file("my_hook") == packaged
    assert instrument_file("hook_30") == HOOK  # a shipped one hides it
    for check in instruments.CHECKS:
        check.run("my_hook")
    scenario = load_scenario("circle_lwr4plus", assignments=["instrument={name: my_hook}"])
    before = scenario.sha256()
    assert load_scenario(scenario.resolved()).sha256() == before
    packaged.write_text(packaged.read_text().replace('mass="0.35"', 'mass="0.36"'))
    assert load_scenario("circle_lwr4plus", assignments=["instrument={name: my_hook}"]).sha256() != before
    with pytest.raises(SurgsimError, match="has changed since files_sha256 was written"):
        load_scenario(scenario.resolved())


def test_a_broken_one_is_told_with_its_package(packaged):
    assert "instrument 'lost' of the package lab 1" in refused(name="lost")
    packaged.write_text(packaged.read_text().replace('name="tip"', 'name="point"'))
    said = refused(name="my_hook")
    assert said.startswith("instrument 'my_hook' of the package lab 1: the instrument has no site 'tip'")
    packaged.write_text("<mujoco>")
    assert "instrument 'my_hook' of the package lab 1: " in refused(name="my_hook")


def test_an_instrument_without_inertia_breaks_its_promise(packaged):
    text = packaged.read_text()
    packaged.write_text(text.replace('diaginertia="0.00568 0.00568 0.000076"', 'diaginertia="0 0 0"'))
    with pytest.raises(BrokenPromiseError, match="a principal moment of inertia is not above zero"):
        instruments.is_physical("my_hook")


def test_the_search_path_names_instruments_too(tmp_path, monkeypatch):
    folder = tmp_path / "mine" / "own_hook"
    folder.mkdir(parents=True)
    shutil.copy(HOOK, folder / "own_hook.xml")
    monkeypatch.setenv(SEARCH_PATH, str(tmp_path / "mine"))
    assert instrument_names() == [*SHIPPED, "own_hook"]
    assert InstrumentConfig(name="own_hook").files_sha256
    monkeypatch.setenv(SEARCH_PATH, str(tmp_path / "nowhere"))
    assert f"{SEARCH_PATH} lists {tmp_path / 'nowhere'}, which is no folder" in refused(name="own_hook")
