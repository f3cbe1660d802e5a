"""Numbers beyond what their unit allows are refused; extreme ones never give a traceback."""

import copy
from contextlib import suppress
from functools import cache
from typing import get_args, get_origin

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from surgsim.errors import ScenarioError, SurgsimError
from surgsim.scenario.load import load_scenario
from surgsim.scenario.magnitudes import UNITS, unit_of
from surgsim.scenario.messages import unwrap
from surgsim.scenario.schema import Scenario
from surgsim.scenario.validate import validate
from surgsim.scenario.yaml_text import dump_yaml, parse_yaml
from surgsim.simulate.setup import prepare

BASES = (
    "theatre_lwr4plus",
    "circle_panda",
    "insertion_lwr4plus",
    "peg_and_ring_panda",
    "rcm_human_push_panda",
)


@pytest.mark.parametrize(
    ("assignment", "reason"),
    [
        (
            "robot.base_position_m=[1e9, 0, 0]",
            "robot.base_position_m.0: 1e+09 is not allowed: the size of a number in m must be 0, or from "
            "1e-30 to 100; what is farther away cannot be reached",
        ),
        (
            "start.posture_rad=[0, 0, -1e9, 0, 0, 0, 0]",
            "start.posture_rad.2: -1e+09 is not allowed: the size of a number in rad must be 0, or from "
            "1e-30 to 100",
        ),
        (
            "robot.base_yaw_rad=1000000000",
            "robot.base_yaw_rad: 1e+09 is not allowed: the size of a number in rad must be 0, or from "
            "1e-30 to 100",
        ),
        (
            "task.duration_s=1e-31",
            "task.duration_s: 1e-31 is not allowed: the size of a number in s must be 0, or from 1e-30 to "
            "1e+09",
        ),
        (
            "trocar.axis=[0, 0, 1e20]",
            "trocar.axis.2: 1e+20 is not allowed: the size of a number must be 0, or from 1e-30 to 1e+15",
        ),
    ],
)
def test_a_number_beyond_its_unit_is_refused_in_one_line(assignment, reason):
    with pytest.raises(ScenarioError) as refused:
        load_scenario("circle_lwr4plus", assignments=[assignment])
    assert str(refused.value).endswith(f": {reason}")


def _keys(shape, path=()):
    """Paths of all numbers of the schema."""
    if shape.is_model:
        for key in shape.fields():
            yield from _keys(shape.child(key), (*path, key))
    elif shape.is_union:
        members = shape.members().values() if shape.tag else map(unwrap, get_args(shape.core))
        for member in members:
            yield from _keys(member, path)
    elif get_origin(shape.core) in (tuple, list):
        yield from _keys(shape.child(0), (*path, 0))
    elif shape.core is float:
        yield path


def test_every_unit_of_the_schema_is_known():
    """A key that ends in a new unit must get a bound, or be listed as one without."""
    keys = {next(key for key in reversed(path) if isinstance(key, str)) for path in _keys(unwrap(Scenario))}
    assert len(keys) > 100
    units = {unit.rpartition("_")[2] for unit in UNITS}
    assert {key for key in keys if key.split("_")[-1] in units and unit_of((key,)) is None} == set()
    assert unit_of(("disturbances", 0, "position_m", 2)) == "m"
    assert unit_of(("rcm_stiffness_n_per_m",)) == "n_per_m"
    assert unit_of(("gain_rad2_per_s",)) == "per_s"
    assert unit_of(("radius",)) is None


@cache
def _tree(name):
    return load_scenario(name, assignments=["theatre=false"]).resolved()


def _numbers(tree, path=()):
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        if isinstance(value, float):
            yield (*path, key)
        elif isinstance(value, dict | list):
            yield from _numbers(value, (*path, key))


PLACES = [(name, path) for name in BASES for path in _numbers(_tree(name))]
SIZES = st.one_of(
    st.floats(-30.0, 15.0).map(lambda power: 10.0**power),
    st.sampled_from([1e-30, 1e-12, 1e-9, 1.0, 99.0, 1e3, 1e6, 1e9, 1e12, 1e15]),
)
NUMBERS = st.one_of(
    SIZES, SIZES.map(lambda size: -size), st.just(0.0), st.floats(allow_nan=False, allow_infinity=False)
)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(place=st.sampled_from(PLACES), number=NUMBERS)
def test_an_extreme_number_is_checked_or_refused_and_never_a_traceback(place, number):
    name, path = place
    tree = copy.deepcopy(_tree(name))
    node = tree
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = number
    with suppress(SurgsimError):
        prepare(validate(Scenario, parse_yaml(dump_yaml(tree), "made.yaml")))
