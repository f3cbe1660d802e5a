"""Suites: their keys, their runs in order, their errors."""

import re
from pathlib import Path

import pytest

from surgsim.catalog import PartConfig
from surgsim.compare.suite import (
    MOST_RUNS,
    SuiteConfig,
    ad_hoc_suite,
    check_runs,
    expand,
    is_suite,
    load_suite,
    parse_seeds,
    with_changes,
)
from surgsim.errors import ScenarioError, SurgsimError
from surgsim.scenario.load import load_scenario, shipped
from surgsim.scenario.yaml_text import parse_yaml

MINIMAL = "name: small\nscenarios: [circle_lwr4plus]\n"


@pytest.fixture
def write(tmp_path):
    """Writes a suite's file and returns its path."""

    def to_file(text):
        path = tmp_path / "small.yaml"
        path.write_text(text)
        return str(path)

    return to_file


@pytest.mark.parametrize(
    ("text", "seeds"),
    [
        ("3", (3,)),
        ("0:4", (0, 1, 2, 3)),
        ("1,4,9", (1, 4, 9)),
        (" 7 , 0:2", (7, 0, 1)),
        ("999999998:999999999", (999999998,)),
    ],
)
def test_seeds(text, seeds):
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "a", "1;2", "-1", "0:3:2", "1,,2", "1.0", "1234567890"])
def test_what_is_no_list_of_seeds(text):
    with pytest.raises(ValueError, match=r"is not a list of seeds: write 0:10, 3 or 1,4,9") as error:
        parse_seeds(text)
    assert str(error.value).startswith(f"'{text}' is")


@pytest.mark.parametrize("text", ["5:5", "5:3", "1,1", "0:3,2", "0:100001", "0:999999999", "7,0:999999999"])
def test_seeds_that_are_none_or_twice_or_too_many(text):
    with pytest.raises(ValueError, match=f"'{text}' must name between one and 100000 different seeds"):
        parse_seeds(text)


def test_the_runs_in_their_order(write):
    suite, folder = load_suite(
        write(
            "name: small\nscenarios: [circle_lwr4plus, spiral_lwr4plus]\ncontrollers: [vprnn, pinv]\n"
            'grid: {task.ramp_s: [1.0, 2.0], safety.stop_at_joint_limit: [true]}\nseeds: "4,2"\n'
        )
    )
    specs = expand(suite, folder)
    assert [(s.scenario, s.controller, dict(s.parameters)["task.ramp_s"], s.seed) for s in specs] == [
        (scenario, controller, ramp, seed)
        for scenario in ("circle_lwr4plus", "spiral_lwr4plus")
        for controller in ("vprnn", "pinv")
        for ramp in (1.0, 2.0)
        for seed in (4, 2)
    ]
    scenarios = check_runs(specs)
    for spec, scenario in zip(specs, scenarios, strict=True):
        assert scenario == spec.load()
        assert (scenario.name, scenario.controller.name) == (spec.scenario, spec.controller)
        assert (scenario.task.ramp_s, scenario.seed) == (dict(spec.parameters)["task.ramp_s"], spec.seed)


def test_defaults(write):
    suite, folder = load_suite(write(MINIMAL))
    assert suite == SuiteConfig(name="small", scenarios=("circle_lwr4plus",))
    (spec,) = expand(suite, folder)
    assert (spec.controller, spec.parameters, spec.settings, spec.seed, spec.record) == (
        None,
        (),
        (),
        0,
        False,
    )
    assert check_runs([spec]) == [load_scenario("circle_lwr4plus")]


def test_the_grid_may_hold_whole_parts_and_wins_over_settings(write):
    text = MINIMAL + (
        'settings: [task.radius_m=0.01, "disturbances=[{type: payload}]"]\n'
        "grid:\n  task.radius_m: [0.015]\n  disturbances: [[], [{type: payload, mass_kg: 0.5}]]\n"
    )
    scenarios = check_runs(expand(*load_suite(write(text))))
    assert [scenario.task.radius_m for scenario in scenarios] == [0.015, 0.015]
    assert [[part.mass_kg for part in scenario.disturbances] for scenario in scenarios] == [[], [0.5]]


def test_paths_are_relative_to_the_suites_file(write, tmp_path, monkeypatch):
    monkeypatch.chdir("/")
    (tmp_path / "mine.yaml").write_text((shipped()["circle_lwr4plus"]).read_text().replace("circle_", "my_"))
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "ctl.yaml").write_text(shipped("controllers")["pinv"].read_text())
    suite = write("name: small\nscenarios: [mine.yaml]\ncontrollers: [sub/ctl.yaml, vprnn]\n")
    scenarios = check_runs(expand(*load_suite(suite)))
    assert [(s.name, s.controller.name) for s in scenarios] == [
        ("my_lwr4plus", "pinv"),
        ("my_lwr4plus", "vprnn"),
    ]


def test_a_controller_given_on_the_command_line_is_relative_to_the_working_directory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ctl.yaml").write_text(shipped("controllers")["pinv"].read_text())
    suite, folder = load_suite("quick")
    specs = expand(with_changes(suite, ["ctl.yaml"], "0", False), folder)
    assert {scenario.controller.name for scenario in check_runs(specs)} == {"pinv"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "name: small\n",
            "small.yaml:1: scenarios: missing. Expected a list of strings.",
        ),
        (
            MINIMAL + "seeds: 0:x\n",
            "small.yaml:3: seeds: '0:x' is not a list of seeds: write 0:10, 3 or 1,4,9",
        ),
        (
            MINIMAL + "controler: [vprnn]\n",
            "small.yaml:3: controler: unknown key (value ['vprnn']). Allowed: name, description, ",
        ),
        (
            MINIMAL + "grid: {task.ramp_s: []}\n",
            "small.yaml:3: grid.task.ramp_s: [] has 0 items. Expected at least 1 items.",
        ),
        (
            MINIMAL + "name: twice\n",
            "small.yaml:3: name: duplicate key, first given on line 1",
        ),
        (
            "name: Small Suite\nscenarios: [circle_lwr4plus]\n",
            "small.yaml:1: name: 'Small Suite' must be lower-case letters, digits and underscores, ",
        ),
    ],
    ids=["missing", "seeds", "unknown key", "empty grid", "twice", "name"],
)
def test_a_wrong_suite_names_file_line_and_key(write, text, message):
    with pytest.raises(ScenarioError) as error:
        load_suite(write(text))
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "name: small\nscenarios: [circel_lwr4plus]\n",
            "'circel_lwr4plus' is not a shipped scenario. Known: breathing_hidden_lwr4plus, ",
        ),
        (MINIMAL + "controllers: [vprn]\n", "--controller: 'vprn' is not a shipped controller. Known: "),
        (
            MINIMAL + "grid: {task.radios_m: [0.01]}\n",
            "--set task.radios_m=0.01: task.radios_m: unknown key (value 0.01). Allowed: start_m, ",
        ),
        (
            MINIMAL + "grid: {task.radius_m: [0.01, -1]}\n",
            "--set task.radius_m=-1: task.radius_m: -1 is not allowed: must be greater than 0",
        ),
        (MINIMAL + "settings: [nonsense]\n", "--set nonsense: write --set key.path=value"),
    ],
    ids=["scenario", "controller", "grid key", "grid value", "setting"],
)
def test_every_run_is_checked_before_any(write, text, message):
    with pytest.raises(ScenarioError) as error:
        check_runs(expand(*load_suite(write(text))))
    assert str(error.value).startswith(message)


def test_too_many_runs_are_refused_before_they_are_listed():
    grid = {f"key{i}": tuple(range(10)) for i in range(30)}  # 1e30 points: listing them would never end
    suite = SuiteConfig(name="huge", scenarios=("circle_lwr4plus",), grid=grid)
    with pytest.raises(SurgsimError, match=f"suite 'huge' has 1{'0' * 30} runs; at most {MOST_RUNS} are"):
        expand(suite, None)


@pytest.mark.parametrize(
    ("names", "called"),
    [
        (["circle_lwr4plus"], "circle_lwr4plus"),
        (["circle_lwr4plus", "spiral_lwr4plus"], "circle_lwr4plus_and_1_more"),
        (["some/Folder/My Path-2.yaml"], "my_path_2"),
        (["_draft.yaml"], "draft"),
        (["_.yaml"], "suite"),
        (["x" * 200 + ".yaml"], "x" * 64),
    ],
)
def test_an_ad_hoc_suite_has_a_name(names, called):
    suite = ad_hoc_suite(names, ["vprnn"])
    assert (suite.name, suite.scenarios, suite.controllers) == (called, tuple(names), ("vprnn",))


def test_a_suite_is_told_from_a_scenario(write, tmp_path):
    assert is_suite("quick")
    assert is_suite(write(MINIMAL))
    assert not is_suite("circle_lwr4plus")
    assert not is_suite(str(shipped()["circle_lwr4plus"]))
    assert not is_suite("nothing_like_it")
    with pytest.raises(ScenarioError, match=r"nothing\.yaml: cannot be read"):
        is_suite(str(tmp_path / "nothing.yaml"))


def test_what_the_command_line_says_instead():
    suite = SuiteConfig(name="small", scenarios=("circle_lwr4plus",), controllers=("vprnn",), seeds="0:9")
    assert with_changes(suite, None, None, False) == suite
    assert with_changes(suite, None, None, False, ["task.radius_m=0.01"]).settings == (
        *suite.settings,
        "task.radius_m=0.01",
    )
    changed = with_changes(suite, ["pinv", "qp"], "3", True)
    assert (changed.controllers, changed.seeds, changed.record) == (("pinv", "qp"), "3", True)
    with pytest.raises(ScenarioError) as error:
        with_changes(suite, None, "x", False)
    assert str(error.value) == "--seeds: 'x' is not a list of seeds: write 0:10, 3 or 1,4,9"


@pytest.mark.parametrize("name", sorted(shipped("suites")))
def test_every_shipped_suite_can_be_run(name):
    suite, folder = load_suite(name)
    assert suite.name == name
    assert suite.description
    specs = expand(suite, folder)
    first = specs[0]
    every_pair = [spec for spec in specs if (spec.parameters, spec.seed) == (first.parameters, first.seed)]
    same_pair = [
        spec for spec in specs if (spec.scenario, spec.controller) == (first.scenario, first.controller)
    ]
    assert check_runs([*every_pair, *same_pair])


def test_the_full_suite_leaves_nothing_out():
    suite, folder = load_suite("full")
    compared = ("_lwr4plus", "_panda")  # the arms that the suites are for
    paths = [name for name in shipped() if name.startswith(("circle", "sinusoid", "spiral"))]
    paths = [name for name in paths if name.endswith(compared)]
    assert sorted(suite.scenarios) == sorted(paths)
    elsewhere = {
        "passive_convex",
        "passive_elastic",
        "passive_kinetic",
        "hands_on_admittance",
    }  # made for an operator, and for a hand
    elsewhere |= {"rcm_interaction_force", "rcm_port_admittance"}  # for a wall
    elsewhere |= {
        "rcm_elastic_dynamics",
        "joint_elastic_dynamics",
        "joint_impedance_tuned",
        "rcm_mpc",
        "rcm_sliding_mode",
        "adaptive_decoupling",
    }  # for real drives
    elsewhere |= {
        "constraint_consistent",
        "projected_jacobian",
        "null_space_basis",
    }  # for the torque-level settings
    elsewhere |= {"external_torque", "external_velocity"}  # these need a program
    assert set(suite.controllers) == set(shipped("controllers")) - elsewhere
    assert len(expand(suite, folder)) == 4680
    assert len(expand(*load_suite("seeds"))) == 240
    assert len(expand(*load_suite("nominal"))) == 48
    assert len(expand(*load_suite("quick"))) == 36


def test_every_key_is_documented_with_its_default():
    page = (Path(__file__).parents[2] / "docs" / "batch.md").read_text()
    section = page.split("## Suite files")[1].split("\n## ")[0]
    rows = dict(re.findall(r"^\| `(\w+)` \| .+? \| (.+?) \| .+ \|$", section, re.M))
    assert list(rows) == list(SuiteConfig.model_fields)
    for key, field in SuiteConfig.model_fields.items():
        if field.is_required():
            assert rows[key] == "required"
        else:
            default = field.get_default(call_default_factory=True)
            shown = list(default) if isinstance(default, tuple) else default
            shown = shown.model_dump() if isinstance(shown, PartConfig) else shown
            assert parse_yaml(f"x: {rows[key].strip('`')}", key).tree["x"] == shown


def test_the_suite_of_the_documents_is_valid(write, tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "batch.md").read_text()
    text = re.search(r"^```text\n(name: .*?)^```$", page, re.M | re.S)[1]
    (tmp_path / "my_path.yaml").write_text(shipped()["spiral_lwr4plus"].read_text())
    own = shipped("controllers")["pinv"].read_text()
    (tmp_path / "my_controller.yaml").write_text(own)
    assert len(check_runs(expand(*load_suite(write(text))))) == 2 * 2 * 3 * 2 * 10
