"""The FR3's limits, drives and mass, and what its published tensors are about."""

import numpy as np
import pytest
from published_arms import FR3, FR3_COMS, FR3_MASSES, FR3_TENSORS_ABOUT_ORIGINS, tensor

from surgsim.models.build import Scene, build_arm
from surgsim.models.config import RobotConfig, SceneConfig

# frankarobotics/libfranka, test/fr3.urdf, link 1: about the centre of mass, of an earlier fit.
LIBFRANKA_LINK_1 = tensor(0.0186029651, 0.0181195421, 0.0053883661, 1.3296e-05, -0.0001140944, 5.33017e-05)


@pytest.fixture(scope="module")
def arm() -> Scene:
    return build_arm(SceneConfig(robot=RobotConfig(name="fr3"), instrument=None))


def test_the_published_tensors_are_about_the_links_origins():
    """Reduced to the centre of mass, link 1 is libfranka's and the rest obey the fit's margin of 1e-9."""
    np.testing.assert_allclose(FR3.tensors[0], LIBFRANKA_LINK_1, atol=1e-10)
    for reduced, printed in zip(FR3.tensors[1:], FR3_TENSORS_ABOUT_ORIGINS[1:], strict=True):
        small, middle, large = np.linalg.eigvalsh(reduced)
        assert small + middle - large == pytest.approx(1e-9, abs=1e-13)
        small, middle, large = np.linalg.eigvalsh(printed)
        assert small + middle - large > 1e-7


def test_the_links_are_those_of_the_published_table(arm):
    for i, (mass, com) in enumerate(zip(FR3_MASSES, FR3_COMS, strict=True)):
        body = arm.model.body(f"link{i + 1}")
        assert body.mass[0] == mass
        np.testing.assert_array_equal(body.ipos, com)


def test_limits(arm):
    limits = arm.limits
    np.testing.assert_array_equal(limits.q_max, [2.9007, 1.8361, 2.9007, -0.1169, 2.8763, 4.6216, 3.0508])
    np.testing.assert_array_equal(
        limits.q_min, [-2.9007, -1.8361, -2.9007, -3.0770, -2.8763, 0.4398, -3.0508]
    )
    np.testing.assert_array_equal(limits.velocity, [2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26])
    np.testing.assert_array_equal(limits.acceleration, 10)
    np.testing.assert_array_equal(limits.jerk, 5000)
    np.testing.assert_array_equal(limits.torque, [87] * 4 + [12] * 3)
    np.testing.assert_array_equal(limits.torque_rate, 1000)


def test_drive_constants(arm):
    rotors = [0.605721456] * 2 + [0.462474144] * 2 + [0.205544064] * 3
    np.testing.assert_array_equal(arm.model.dof_armature, rotors)
    np.testing.assert_array_equal(np.ravel(arm.model.dof_damping), 0.21)
    np.testing.assert_array_equal(arm.model.dof_frictionloss, 0)


def test_total_mass(arm):
    total = arm.model.body_mass.sum()
    assert total == pytest.approx(2.3966 + sum(FR3_MASSES), abs=1e-12)
    assert total == pytest.approx(17.8, rel=0.01)  # the Panda's weight in its product manual
