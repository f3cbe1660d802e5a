"""The LBR iiwa 14 against its data sheet and against what was identified on the arm."""

import mujoco
import numpy as np
import pytest
from published_arms import PublishedArm, craig

from surgsim.models.build import Scene, build_arm
from surgsim.models.config import RobotConfig, SceneConfig

H = np.pi / 2
# The data sheet's lengths in modified DH. Masses and centres of mass: Stuerz, Affolter and Smith, "Parameter
# identification of the KUKA LBR iiwa robot including constraints on physical feasibility", IFAC 2017, as
# public programs quote them.
IDENTIFIED = PublishedArm(
    placements=tuple(
        craig(alpha, 0, d)
        for alpha, d in zip((0, H, -H, -H, H, H, -H), (0.36, 0, 0.42, 0, 0.4, 0, 0), strict=True)
    ),
    flange_m=0.126,
    masses=(3.94781, 4.50275, 2.45520, 2.61155, 3.41, 3.38795, 0.35432),
    coms=(
        (-0.00351, 0.00160, -0.03139),
        (-0.00767, 0.16669, -0.00355),
        (-0.00225, -0.03492, -0.02652),
        (0.00020, -0.05268, 0.03818),
        (0.00005, -0.00237, -0.21134),
        (0.00049, 0.02019, -0.02750),
        (-0.03466, -0.02324, 0.07138),
    ),
    tensors=(np.eye(3),) * 7,
)


@pytest.fixture(scope="module")
def arm() -> Scene:
    return build_arm(SceneConfig(robot=RobotConfig(name="iiwa14"), instrument=None))


@pytest.fixture(scope="module")
def postures(arm) -> np.ndarray:
    """Random postures (300, 7) [rad]."""
    return np.random.default_rng(0).uniform(arm.limits.q_min, arm.limits.q_max, (300, 7))


def _at(arm: Scene, q) -> mujoco.MjData:
    data = mujoco.MjData(arm.model)
    data.qpos[arm.qpos_ids] = q
    mujoco.mj_forward(arm.model, data)
    return data


def _facing_back(q) -> np.ndarray:
    """The same posture in the paper's angles: its joint 1 counts from the other side of the base."""
    return np.add(q, (np.pi, 0, 0, 0, 0, 0, 0))


def test_the_flange_is_where_the_data_sheet_s_lengths_put_it(arm, postures):
    for q in postures[:30]:
        flange = _at(arm, q).site_xpos[arm.flange_site]
        np.testing.assert_allclose(flange, IDENTIFIED.flange(_facing_back(q)), atol=1e-12)


def test_gravity_torque_is_the_identified_one(arm, postures):
    """Masses differ, since only their combinations act: joint 2 carries 53 N m RMS."""
    off, carried = [], []
    for q in postures:
        torque, step = _at(arm, q).qfrc_bias[arm.dof_ids], 1e-6 * np.eye(7)
        energies = [
            (
                IDENTIFIED.potential_energy(_facing_back(q + h)),
                IDENTIFIED.potential_energy(_facing_back(q - h)),
            )
            for h in step
        ]
        off.append(torque - [(up - down) / 2e-6 for up, down in energies])
        carried.append(torque)
    rms = np.sqrt(np.mean(np.square(off), axis=0))
    assert (rms < [1e-6, 0.7, 0.45, 0.6, 0.2, 0.2, 0.1]).all()
    assert np.sqrt(np.mean(np.square(carried), axis=0))[1] == pytest.approx(53, abs=2)


def test_at_zero_the_arm_stands_straight_up_and_its_frames_are_the_base_s(arm):
    data = _at(arm, np.zeros(7))
    np.testing.assert_allclose(data.site_xpos[arm.flange_site], (0, 0, 1.306), atol=1e-12)
    np.testing.assert_allclose(data.xmat.reshape(-1, 3, 3), np.broadcast_to(np.eye(3), (9, 3, 3)), atol=1e-12)
    axes = [(0, 0, 1), (0, 1, 0), (0, 0, 1), (0, -1, 0), (0, 0, 1), (0, 1, 0), (0, 0, 1)]
    np.testing.assert_allclose(data.xaxis, axes, atol=1e-12)
    heights = [0, 0, 0.36, 0.36, 0.78, 0.78, 1.18, 1.18, 1.18]  # world, base, links 1 to 7
    np.testing.assert_allclose(data.xpos, [(0, 0, z) for z in heights], atol=1e-12)


def test_limits(arm):
    limits = arm.limits
    np.testing.assert_allclose(np.degrees(limits.q_max), [170, 120, 170, 120, 170, 120, 175])
    np.testing.assert_allclose(limits.q_min, -limits.q_max)
    np.testing.assert_allclose(np.degrees(limits.velocity), [85, 85, 100, 75, 130, 135, 135])
    np.testing.assert_array_equal(limits.acceleration, [8.57, 8.57, 8.74, 11.36, 12.23, 15.72, 15.72])
    np.testing.assert_array_equal(limits.torque, [320, 320, 176, 176, 110, 40, 40])
    assert np.isinf(limits.jerk).all()
    assert np.isinf(limits.torque_rate).all()


def test_drive_constants(arm):
    rotors = [160**2 * 1.321e-4] * 4 + [100**2 * 1.321e-4] + [160**2 * 4.54e-5] * 2
    np.testing.assert_allclose(arm.model.dof_armature, rotors, rtol=1e-12)
    np.testing.assert_array_equal(np.ravel(arm.model.dof_damping), 0.5)
    np.testing.assert_array_equal(arm.model.dof_frictionloss, 0)


def test_total_mass_is_the_data_sheet_s(arm):
    assert arm.model.body_mass.sum() == pytest.approx(29.9, abs=1e-9)
