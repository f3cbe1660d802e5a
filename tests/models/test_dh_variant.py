"""The misprinted Denavit-Hartenberg table of the manipulability paper as a variant of the LWR4+."""

import numpy as np
import pytest
from pydantic import ValidationError

from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig, SceneConfig

TWISTS = np.array([1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 0.0]) * np.pi / 2


def flange(q, d2):
    """Flange position from the classical table, row by row."""
    T = np.eye(4)
    for theta, d, alpha in zip(q, (0.31, d2, 0.4, 0.0, 0.39, 0.0, 0.078), TWISTS, strict=True):
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        T = T @ [[c, -s * ca, s * sa, 0], [s, c * ca, -c * sa, 0], [0, sa, ca, d], [0, 0, 0, 1]]
    return T[:3, 3]


@pytest.mark.parametrize(("variant", "d2"), [("standard", 0.0), ("literal", 0.2)])
def test_the_flange_is_where_the_table_puts_it(variant, d2):
    robot = RobotConfig(name="lwr4plus", dh_variant=variant)
    arm = ArmModel(SceneConfig(robot=robot, instrument=None))
    for q in np.random.default_rng(5).uniform(-2.0, 2.0, (4, 7)):
        np.testing.assert_allclose(arm.kinematics(q).p_WT, flange(q, d2), atol=1e-12)


def test_no_other_robot_has_the_variant():
    with pytest.raises(ValidationError):
        RobotConfig(name="panda", dh_variant="literal")
    with pytest.raises(ValidationError, match="'standard' or 'literal'"):
        RobotConfig(name="lwr4plus", dh_variant="exact")
