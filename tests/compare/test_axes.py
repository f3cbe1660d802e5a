"""Axes and sweeps of a suite: their runs, what these set, and what is refused."""

import re
from pathlib import Path

import pytest

from surgsim.compare.axis import AxisConfig
from surgsim.compare.suite import check_runs, expand, load_suite, with_changes
from surgsim.errors import ScenarioError, SurgsimError

HEAD = "name: small\nscenarios: [circle_lwr4plus]\ncontrollers: [vprnn, rcm_inverse_dynamics]\n"
AXES = """axes:
  ramp: {levels: [0.5, 1], key: task.ramp_s}
  gain:
    levels: [0.5, 1.0]
    controllers:
      vprnn: {controller.torque_law.rcm_stiffness_n_per_m: [400.0, 800.0]}
      rcm_inverse_dynamics: {controller.torque_law.rcm_stiffness_per_s2: [1.0e+4, 2.0e+4]}
"""
SWEEPS = """sweeps:
  payload: {levels: [0.1, 0.2], key: disturbances.0.mass_kg, settings: ["disturbances=[{type: payload}]"]}
  push:
    levels: [5.0]
    values: {disturbances.0.force_n: [[0.0, 5.0, 0.0]]}
    settings: ["disturbances=[{type: push}]"]
"""


@pytest.fixture
def load(tmp_path):
    """Loads a suite from text."""

    def from_text(text):
        path = tmp_path / "small.yaml"
        path.write_text(text)
        return load_suite(str(path))

    return from_text


def test_axes_are_combined_and_set_each_controller_s_own_keys(load):
    specs = expand(*load(HEAD + AXES))
    wanted = [(("ramp", ramp), ("gain", gain)) for ramp in (0.5, 1.0) for gain in (0.5, 1.0)]
    assert [spec.parameters for spec in specs] == 2 * wanted
    scenarios = check_runs(specs)
    assert [scenario.task.ramp_s for scenario in scenarios] == 2 * [0.5, 0.5, 1.0, 1.0]
    assert [s.controller.torque_law.rcm_stiffness_n_per_m for s in scenarios[:4]] == 2 * [400.0, 800.0]
    assert [s.controller.torque_law.rcm_stiffness_per_s2 for s in scenarios[4:]] == 2 * [1e4, 2e4]


def test_sweeps_are_varied_one_at_a_time_beside_a_run_without_any(load):
    specs = expand(*load(HEAD + SWEEPS))[:4]
    points = [(), (("payload", 0.1),), (("payload", 0.2),), (("push", 5.0),)]
    assert [spec.parameters for spec in specs] == points
    scenarios = check_runs(specs)
    assert [[part.type for part in s.disturbances] for s in scenarios] == [
        [],
        ["payload"],
        ["payload"],
        ["push"],
    ]
    assert [s.disturbances[0].mass_kg for s in scenarios[1:3]] == [0.1, 0.2]
    assert scenarios[3].disturbances[0].force_n == (0.0, 5.0, 0.0)


def test_grid_axes_and_sweeps_multiply_with_seeds(load):
    specs = expand(*load(HEAD + AXES + SWEEPS + 'grid: {task.radius_m: [0.01, 0.02]}\nseeds: "0:3"\n'))
    assert len(specs) == 2 * (2 * 2 * 2) * (1 + 3) * 3
    assert len({(spec.controller, spec.parameters, spec.seed) for spec in specs}) == len(specs)


BAD = [
    ("axes: {a: {levels: [1.0, 1.0], key: task.ramp_s}}\n", "levels must rise, each above the one before"),
    ("axes: {a: {levels: [1.0, 2.0]}}\n", "an axis needs key, values or controllers: its levels set nothing"),
    (
        "axes: {a: {levels: [1.0], values: {task.ramp_s: [1.0, 2.0]}}}\n",
        "task.ramp_s has 2 values for 1 levels",
    ),
    ("sweeps: {a: {levels: [1.0], key: seed}}\n", "seed cannot be on an axis"),
    ("sweeps: {a: {levels: [], key: task.ramp_s}}\n", "levels"),
    (
        "axes: {a b: {levels: [1.0], key: task.ramp_s}}\n",
        "must be lower-case letters, digits and underscores",
    ),
    (
        "axes: {a: {levels: [1.0], key: task.ramp_s}}\nsweeps: {a: {levels: [1.0], key: task.ramp_s}}\n",
        "a is named twice among grid, axes and sweeps",
    ),
    (
        "axes: {a: {levels: [1.0], controllers: {pinv: {task.ramp_s: [1.0]}}}}\n",
        "a names pinv, no controller of the suite",
    ),
]


@pytest.mark.parametrize(("text", "message"), BAD, ids=[message for _, message in BAD])
def test_a_wrong_axis_is_refused_in_one_line(load, text, message):
    with pytest.raises(ScenarioError) as error:
        load(HEAD + text)
    assert "small.yaml:" in str(error.value)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_an_axis_that_says_nothing_of_a_controller_is_refused(load):
    suite, folder = load(HEAD + AXES)
    assert expand(with_changes(suite, ["vprnn"], None, False), folder)
    with pytest.raises(SurgsimError, match="suite 'small': gain sets nothing for pinv"):
        expand(with_changes(suite, ["vprnn", "pinv"], None, False), folder)


def test_every_key_of_an_axis_is_documented_with_its_default():
    page = (Path(__file__).parents[2] / "docs" / "batch.md").read_text()
    section = page.split("## Axes and sweeps")[1].split("\n## ")[0]
    rows = dict(re.findall(r"^\| `(\w+)` \| .+? \| (.+?) \| .+ \|$", section, re.M))
    shown = {"label": '`""`', "levels": "required", "key": "`null`", "values": "`{}`", "controllers": "`{}`"}
    assert rows == shown | {"settings": "`[]`"}
    assert list(rows) == list(AxisConfig.model_fields)


def test_the_axes_of_the_documents_make_the_points_that_they_say(load):
    page = (Path(__file__).parents[2] / "docs" / "batch.md").read_text()
    text = page.split("## Axes and sweeps")[1].split("```text\n")[1].split("```")[0]
    specs = expand(*load(HEAD + text))
    check_runs(specs)
    assert len(specs) == 2 * 15
