"""What of a config is hashed."""

import importlib
import pkgutil
from contextlib import suppress
from typing import Annotated

import pytest
from pydantic import Field

import surgsim
from surgsim.catalog import ADDED, PartConfig
from surgsim.scenario.hashed import hashed, sha256_of_config
from surgsim.scenario.load import load_experiment
from surgsim.teleop.sight import SightConfig

LATER: dict[tuple[str, str], object] = {
    ("BendingShaftConfig", "level"): "dynamic",
    ("BendingShaftConfig", "settling_s"): 0.005,
    ("DriveConfig", "command"): "torque",
    ("DriveConfig", "impedance_damping_ratio"): 0.7,
    ("DriveConfig", "impedance_stiffness_nm_per_rad"): 1000.0,
    ("DriveConfig", "joint_acceleration_rad_per_s2"): None,
    ("DriveConfig", "joint_jerk_rad_per_s3"): None,
    ("DriveConfig", "past_joint_motion"): "clip",
    ("LateTicksConfig", "stop_after_ticks"): None,
    ("OperatorConfig", "sight"): SightConfig(
        use=False, across_m=0.0007, depth_m=0.001, line_of_sight=(0.0, 0.5, -1.0), corrections=3
    ),
    ("PegBoardConfig", "hold"): "weld",
    ("PegBoardConfig", "jaws_turn_deg"): 0.0,
    ("PassiveQpConfig", "kinetic_lag_s"): 0.0,
    ("PassiveQpConfig", "kinetic_share"): 1.0,
    ("RcmElasticDynamicsConfig", "contact"): "reject",
    ("TeleoperationConfig", "time_limit_s"): None,
}
"""Every key that is marked as `ADDED`, by its config, and its default."""


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


def test_a_whole_number_is_no_truth_value():
    class Either(PartConfig):
        choice: Annotated[bool | int, ADDED] = True

    assert hashed(Either(choice=1)) == {"choice": 1}
    assert hashed(Either(choice=True)) == {}


@pytest.mark.parametrize("name", ["circle_panda", "theatre_fr3", "teleop_wall_panda", "two_ports_panda"])
def test_every_other_default_counts(name):
    """What is left out is what `LATER` names, wherever it is."""
    scenario = load_experiment(name)
    left_out = set(keys(scenario.resolved())) - set(keys(hashed(scenario)))
    later = {key for _, key in LATER}
    assert all(later & set(place) for place in left_out)


def keys(data, place=()):
    """Places of all keys in plain data."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        if isinstance(data, dict):
            yield (*place, key)
        yield from keys(value, (*place, key))


def test_the_defaults_of_added_keys_stay_for_ever():
    """Another default would change runs whose scenario has the same hash."""
    found = {
        (kind.__name__, name): info.get_default(call_default_factory=True)
        for kind in _configs(PartConfig)
        if kind.__module__.startswith("surgsim.")
        for name, info in kind.model_fields.items()
        if ADDED in info.metadata and name in vars(kind).get("__annotations__", {})
    }
    assert found == LATER


def _configs(kind):
    for module in pkgutil.walk_packages(surgsim.__path__, "surgsim."):
        if module.name != "surgsim.__main__":
            with suppress(ModuleNotFoundError):  # a library that is compared has its own environment
                importlib.import_module(module.name)
    waiting = [kind]
    while waiting:
        each = waiting.pop()
        yield each
        waiting += each.__subclasses__()
