"""Lists with a number for each joint: as many as the robot has, or refused with file, line and key."""

import pytest
from pydantic import ValidationError

from surgsim.control.torque_laws.joint_impedance import JointImpedanceConfig
from surgsim.errors import ScenarioError
from surgsim.scenario.load import load_scenario
from surgsim.scenario.schema import Scenario

SCENARIO = """name: made
robot: {name: ROBOT}
trocar: {position_m: [0.0, 0.55, 0.20]}
start:
  posture_rad: POSTURE
task: {type: circle, radius_m: 0.002, start_m: [0.002, 0.55, 0.02]}
controller:
  name: made
  resolver: {type: pinv}
  torque_law:
    type: joint_impedance
    damping_nm_s_per_rad: DAMPING
"""


@pytest.fixture
def load(tmp_path):
    def loaded(robot, posture="null", damping="null"):
        text = SCENARIO.replace("ROBOT", robot).replace("POSTURE", posture).replace("DAMPING", damping)
        (tmp_path / "made.yaml").write_text(text)
        return load_scenario(tmp_path / "made.yaml")

    return loaded


@pytest.mark.parametrize("joints", [6, 7, 8])
def test_a_list_of_the_arm_s_length_is_taken(load, joints):
    numbers = str([0.5] * joints)
    made = load(f"test_arm_{joints}", numbers, numbers)
    assert made.start.posture_rad == made.controller.torque_law.damping_nm_s_per_rad == (0.5,) * joints


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (
            ("test_arm_6", str([0.5] * 7)),
            "5: start.posture_rad: [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5] has 7 items; "
            "robot 'test_arm_6' has 6 joints. Expected 6 numbers.",
        ),
        (
            ("panda", "null", "[1.0]"),
            "12: controller.torque_law.damping_nm_s_per_rad: [1.0] has 1 item; "
            "robot 'panda' has 7 joints. Expected 7 numbers.",
        ),
        (
            ("panda", "[]"),
            "5: start.posture_rad: [] has 0 items; robot 'panda' has 7 joints. Expected 7 numbers.",
        ),
        (
            ("panda", "0.5"),
            "5: start.posture_rad: 0.5 (a number) is not a list of numbers, one for each joint or null",
        ),
    ],
)
def test_another_one_is_refused(load, tmp_path, keys, said):
    with pytest.raises(ScenarioError) as refused:
        load(*keys)
    assert str(refused.value) == f"{tmp_path / 'made.yaml'}:{said}"


def test_a_scenario_made_in_python_is_refused_too(load):
    made = load("test_arm_8")
    law = JointImpedanceConfig(stiffness_nm_per_rad=(1.0,) * 7)
    controller = made.controller.model_copy(update={"torque_law": law})
    tree = {**dict(made), "controller": controller}
    with pytest.raises(ValidationError, match="has 7 items; robot 'test_arm_8' has 8 joints"):
        Scenario(**tree)


def test_the_arms_for_tests_are_not_listed_and_no_other_name_is_taken(load):
    with pytest.raises(
        ScenarioError, match=r"'test_arm_9' is not a robot. Known: fr3, iiwa14, lwr4plus, panda\."
    ):
        load("test_arm_9")
