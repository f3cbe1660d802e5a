"""A protocol as data, and who may enter its tracks."""

import pytest
from tiny_protocol import TINY, write_protocol

from surgsim.control.external.given_commands import giving
from surgsim.errors import ScenarioError, SurgsimError
from surgsim.protocol import items
from surgsim.protocol.cells import cells, scenario_tree
from surgsim.protocol.definition import entry_file, entry_label, entry_scheme, load_protocol, merged
from surgsim.protocol.entrants import ANY, entrant, refusal, track_for
from surgsim.protocol.seeds import Seeds
from surgsim.scenario.load import load_controller, shipped

SHIPPED = load_protocol()


@pytest.mark.parametrize("track", SHIPPED.config.tracks)
def test_every_entry_may_enter_its_track(track):
    config = SHIPPED.config.tracks[track]
    for entry in config.entries:
        assert refusal(config, load_controller(entry_file(entry))) == ""
        assert entry_scheme(entry) in (config.schemes or ("",))


LATER = {"adaptive_decoupling", "passive_elastic", "rcm_sliding_mode"}
"""Controllers that came after the leaderboard was made; the protocol's teleoperation is on ideal drives."""
TUNED_LATER = {
    "adaptive_decoupling",
    "constraint_consistent_less_damped",
    "null_space_basis",
    "projected_jacobian",
    "rcm_sliding_mode",
}
"""Those of which a tuned file came after it."""


def test_every_shipped_controller_is_an_entry_came_later_or_needs_a_person_or_a_program():
    entries = {entry.partition("+")[0] for track in SHIPPED.config.tracks.values() for entry in track.entries}
    left_out = set(shipped("controllers")) - entries
    assert left_out == {"external_torque", "external_velocity", "hands_on_admittance", *LATER}
    assert {f"tuned/{name}.yaml" for name in set(shipped("tuned")) - TUNED_LATER} <= entries


@pytest.mark.parametrize(
    ("name", "first", "refused"),
    [
        ("vprnn", "nominal", []),
        ("rcm_interaction_force", "nominal", []),
        ("rcm_inverse_dynamics", "port_tracked", ["nominal"]),
        (
            entry_file("protocols/controllers/rcm_elastic_dynamics_tracked.yaml"),
            "instrument_tracked",
            ["nominal", "port_tracked", "velocity_level"],
        ),
    ],
)
def test_a_controller_enters_where_all_that_it_reads_is_given(name, first, refused):
    who = entrant(name)
    assert track_for(SHIPPED, who, None) == first
    for track in refused:
        with pytest.raises(SurgsimError, match=f"may not enter track '{track}': it reads "):
            track_for(SHIPPED, who, track)


def test_only_a_track_with_a_servo_takes_a_controller_without_torques():
    config = load_controller({"name": "mine", "resolver": {"type": "pinv"}})
    tracks = {name for name, track in SHIPPED.config.tracks.items() if not refusal(track, config)}
    assert tracks == {"velocity_level"}


def test_nothing_of_the_nominal_track_measures_the_port():
    track = SHIPPED.config.tracks["nominal"]
    assert ANY not in track.ports
    for cell in cells(SHIPPED, "nominal", ("panda",), Seeds(), load_controller("vprnn")):
        seen = [getattr(part, "seen", "hidden") for part in cell.scenario.disturbances]
        assert set(seen) == {"hidden"}, cell.id


def test_the_servo_takes_the_place_of_the_entrants_torque_law(tiny):
    found = cells(tiny, "velocity_level", ("panda",), Seeds(), load_controller("gradient"), "soft")
    laws = {
        (cell.scenario.controller.torque_law.type, cell.scenario.controller.evaluate_at) for cell in found
    }
    assert laws == {("joint_impedance", "reference")}
    assert {cell.scenario.controller.torque_law.stiffness_factor for cell in found} == {0.5}


def test_cells_are_sorted_and_named_by_what_they_are(tiny):
    found = cells(tiny, "nominal", ("panda", "lwr4plus"), Seeds(), load_controller("pinv"))
    assert [cell.id for cell in found] == sorted(cell.id for cell in found)
    assert [cell.id for cell in found if cell.arm == "panda"] == [
        "circle/panda/base/0",
        "circle/panda/base/1",
        "circle/panda/payload=0.1/0",
        "circle/panda/payload=10/0",
    ]
    heavy = next(cell for cell in found if cell.level == 10.0)
    assert heavy.scenario.disturbances[1].mass_kg == 10.0
    assert heavy.scenario.thresholds.trocar_force_max_n is None


def test_a_drawn_scenario_is_that_of_its_seed():
    found = cells(SHIPPED, "nominal", ("fr3",), Seeds(), load_controller("pinv"))
    ports = {cell.scenario.trocar.position_m for cell in found if cell.generator == "random"}
    assert len(ports) == SHIPPED.config.generators["random"].seeds


def test_an_external_program_is_an_entrant_with_the_hash_of_its_file(tmp_path):
    program = tmp_path / "mine.py"
    program.write_text("pass", encoding="utf-8")
    with giving({"mine": f"python {program}"}):
        who = entrant(None)
    assert who.name == "mine"
    assert who.config.torque_law.name == "mine"
    assert list(who.weights) == ["mine.py"]


def test_a_scheme_is_part_of_the_name_that_a_passport_bears():
    alone = entrant("passive_kinetic", scheme="wave_variables")
    (entry,) = (e for e in load_protocol("surgsim_v1").config.tracks["teleoperation"].entries if "wave" in e)
    assert alone.name == entry_label(entry) == "passive_kinetic_wave_variables"


def test_an_installed_policy_is_an_entrant():
    who = entrant("proportional")
    assert who.config.resolver.name == "proportional"
    assert track_for(SHIPPED, who, None) == "nominal"


def test_the_budget_is_read_from_what_tune_writes_or_declared():
    assert entrant(entry_file("tuned/rcm_mpc.yaml")).tuning["runs"] == 480
    assert entrant("rcm_mpc").tuning["runs"] is None
    assert entrant("rcm_mpc", tuning_runs=7).tuning == {
        "runs": 7,
        "seeds": None,
        "scenarios": None,
        "source": "declared",
    }
    with pytest.raises(SurgsimError, match="--tuning-runs: -1 is not allowed"):
        entrant("rcm_mpc", tuning_runs=-1)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("generators: [circle]", "generators: [square]", "'square' is not a generator. Known: circle."),
        ("metrics: [tip", "metrics: [control_time_p50_us, tip", "depends on the machine"),
        (
            "metrics: [tip_error_max_mm, ",
            "metrics: [",
            "tip_error_max_mm is not among the protocol's metrics",
        ),
        ("metrics: [tip", "metrics: [tap", "'tap_error_max_mm' is not a metric"),
        ("baselines: [pinv]", "baselines: [qp]", "baseline qp is no entry of the track"),
        ("levels: [0.1, 10.0]", "levels: [10.0, 0.1]", "levels must rise"),
        ("kind: held", "kind: held, metric: torque_ratio_max", "a quantile, and no other kind, needs metric"),
        ("  panda:", "  pander:", "'pander' is not a robot"),
        ("name: tiny", "name: other", "a protocol's file has its name"),
    ],
)
def test_a_definition_that_is_wrong_is_refused(tmp_path, old, new, told):
    assert old in TINY
    with pytest.raises(ScenarioError, match=told.replace("(", r"\(")):
        write_protocol(tmp_path, TINY.replace(old, new, 1))


def test_names_that_are_unknown_are_refused(tiny):
    with pytest.raises(SurgsimError, match=r"--track: 'x' is not a track. Known: nominal, port_tracked"):
        tiny.track("x")
    with pytest.raises(SurgsimError, match="--arms: 'fr3' is not a robot of the protocol"):
        tiny.arms_of("fr3")
    with pytest.raises(SurgsimError, match=r"--scheme: track 'velocity_level': 'x' is not a scheme"):
        tiny.settings_of("velocity_level", "x")
    with pytest.raises(SurgsimError, match=r"--scheme: 'x' is not a scheme. Known: none."):
        tiny.settings_of("nominal", "x")
    with pytest.raises(ScenarioError, match="'surgsim_v0' is not a protocol"):
        load_protocol("surgsim_v0")


def test_merged_replaces_all_but_mappings():
    assert merged({"a": {"b": 1, "c": [1, 2]}, "d": 1}, {"a": {"c": [3]}, "d": {"e": 2}}) == {
        "a": {"b": 1, "c": [3]},
        "d": {"e": 2},
    }


def test_every_kind_of_drawn_path_is_among_those_that_are_hashed():
    seeds = Seeds(kind="probe", key=items.PROBE).of("random", items.DRAWS)
    trees = [scenario_tree(SHIPPED, "random", "panda", seed) for seed in seeds]
    assert {tree["task"]["type"] for tree in trees} == {"circle", "sinusoid", "spiral"}
