"""What of a config is hashed."""

from typing import Annotated

from pydantic import Field

from surgsim.catalog import ADDED, PartConfig
from surgsim.scenario.hashed import hashed, sha256_of_config
from surgsim.scenario.load import load_scenario


class Before(PartConfig):
    gain: float = 1.0


class Part(Before):
    limit: Annotated[float | None, ADDED] = None


class Old(PartConfig):
    parts: tuple[Before, ...] = ()
    by_name: dict[str, Before] = Field(default_factory=dict)


class New(PartConfig):
    parts: tuple[Part, ...] = ()
    by_name: dict[str, Part] = Field(default_factory=dict)
    more: Annotated[tuple[float, ...], ADDED] = ()


def test_an_added_key_at_its_default_changes_no_hash_wherever_it_is():
    old = Old(parts=(Before(), Before(gain=2.0)), by_name={"a": Before()})
    new = New(parts=(Part(), Part(gain=2.0)), by_name={"a": Part()})
    assert sha256_of_config(old) == sha256_of_config(new)


def test_an_added_key_that_is_used_counts():
    plain = New(parts=(Part(),))
    assert hashed(New(parts=(Part(limit=3.0),))) == {"parts": [{"gain": 1.0, "limit": 3.0}], "by_name": {}}
    for used in (New(parts=(Part(limit=3.0),)), New(parts=(Part(),), more=(1.0,))):
        assert sha256_of_config(used) != sha256_of_config(plain)


def test_every_other_default_counts():
    scenario = load_scenario("circle_panda")
    assert set(hashed(scenario)) == set(scenario.resolved())
    assert hashed(scenario)["safety"] == scenario.resolved()["safety"]
