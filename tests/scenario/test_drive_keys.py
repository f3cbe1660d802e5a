"""`robot.drive` in a scenario: what it takes, what it fills in, and how it is refused."""

import pytest

import surgsim
from surgsim.errors import ScenarioError
from surgsim.models.drive import real_drive
from surgsim.models.folders import robot_file, shipped_robots


def resolved(**settings):
    return surgsim.load("circle_panda", settings=settings).resolved()["robot"]["drive"]


def test_ideal_is_the_default():
    assert resolved() == "ideal"
    assert surgsim.load("circle_panda").robot.drives is None


def test_real_is_filled_in_from_the_robots_folder():
    drive = resolved(**{"robot.drive": "real"})
    assert drive["rotor_inertia_kg_m2"][0] == 0.605721456
    assert drive["inertia_shaping"] == 4.0
    assert drive["encoder"] == "link"


def test_a_mapping_changes_what_it_names_alone():
    drive = resolved(**{"robot.drive": {"coulomb_nm": 0.5}})
    assert drive["coulomb_nm"] == 0.5
    assert drive["stiffness_nm_per_rad"][0] == 10000.0
    deeper = surgsim.load("theatre_panda", settings={"robot.drive.coulomb_nm": 1.0}).robot.drives
    assert (deeper.coulomb_nm, deeper.friction_spread) == (1.0, 0.2)


@pytest.mark.parametrize("name", shipped_robots())
def test_every_shipped_robot_states_its_drives(name):
    drives = real_drive(robot_file(name).parent)
    assert drives is not None
    drives.check_lengths(7)
    values = drives.values(7)
    assert (values.apparent_inertia * drives.inertia_shaping == values.rotor_inertia).all()


def test_what_is_resolved_loads_to_the_same():
    scenario = surgsim.load("theatre_fr3")
    assert surgsim.load(scenario.resolved()).sha256() == scenario.sha256()


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("rael", r"robot\.drive: 'rael' .* is not one of ideal, real or a mapping"),
        ({"stiffness_nm_per_rad": [1e4, 1e4]}, r"robot\.drive: .*2 items for an arm of 7 joints"),
        ({"coulomb_nm": -1.0}, "must be"),
        ({"coulomb_nm": 1.0, "static_nm": 0.5}, "static_nm 0.5 must be at least coulomb_nm 1"),
        ({"encoder": "both"}, "encoder"),
    ],
    ids=str,
)
def test_what_cannot_be_is_refused_at_its_key(value, said):
    with pytest.raises(ScenarioError, match=said):
        surgsim.load("circle_panda", settings={"robot.drive": value})


def test_an_arm_without_stated_drives_says_what_to_give():
    settings = {"robot.name": "test_arm_6", "robot.drive": "real", "start.posture_rad": None}
    with pytest.raises(ScenarioError, match="give stiffness_nm_per_rad"):
        surgsim.load("circle_panda", settings=settings)


def test_the_kinematic_plant_has_no_drives():
    settings = {"robot.drive": "real", "plant": {"type": "kinematic"}}
    with pytest.raises(ScenarioError, match=r"robot\.drive does not act on the 'kinematic' plant"):
        surgsim.load("circle_panda", settings=settings)
