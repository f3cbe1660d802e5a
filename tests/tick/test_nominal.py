"""The nominal model with a correction of its tip: what is corrected, and the Jacobians of that."""

import numpy as np
import pytest
from scipy.linalg import expm

from surgsim.control.seen import new_seen
from surgsim.spatial import skew
from surgsim.tick.nominal import kinematics, place

V, W = np.array([0.02, -0.03, 0.05]), np.array([0.1, -0.2, 0.15])
STEP = 1e-6


@pytest.fixture
def at(arm):
    """The model of a record, evaluated at joint positions (7,) with or without a correction."""

    def evaluate(q, corrected):
        model = new_seen(arm, dt_s=0.001, has_trocar=False).elsewhere
        X = np.zeros((4, 4))
        X[:3, :3], X[:3, 3] = skew(W), V
        T = expm(X)
        model.corrected, model.p_NT[:], model.R_NT[:] = corrected, T[:3, 3], T[:3, :3]
        kinematics(model, q)
        return model.copy(), T

    return evaluate


def test_tip_and_shaft_are_moved_in_the_nominal_tip_s_frame(at, arm):
    q = np.linspace(0.3, 0.9, 7)
    kin, (model, T) = arm.kinematics(q), at(q, 1)
    np.testing.assert_allclose(model.p_WT, kin.p_WT + kin.R_WT @ T[:3, 3], rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(model.R_WT, kin.R_WT @ T[:3, :3], rtol=0.0, atol=1e-15)
    for name in ("z_W", "anchors_W", "Jw_WT"):
        np.testing.assert_array_equal(model[name], getattr(kin, name))


def test_a_correction_that_does_not_count_changes_nothing(at, arm):
    q = np.linspace(0.3, 0.9, 7)
    kin, (model, _) = arm.kinematics(q), at(q, 0)
    for name in ("p_WT", "R_WT", "Jv_WT", "Jw_WT"):
        np.testing.assert_array_equal(model[name], getattr(kin, name))


def differences(at, q):
    """Jacobians (3, 7) of the corrected tip's position and orientation, by central differences."""
    linear, angular = np.empty((3, 7)), np.empty((3, 7))
    middle = at(q, 1)[0].R_WT
    for j in range(7):
        step = STEP * np.eye(7)[j]
        (low, _), (high, _) = at(q - step, 1), at(q + step, 1)
        linear[:, j] = (high.p_WT - low.p_WT) / (2.0 * STEP)
        turn = (high.R_WT - low.R_WT) @ middle.T / (2.0 * STEP)
        angular[:, j] = turn[2, 1], turn[0, 2], turn[1, 0]
    return linear, angular


@pytest.mark.parametrize("seed", range(3))
def test_jacobians_are_those_of_the_corrected_tip(at, arm, seed):
    q = np.random.default_rng(seed).uniform(-1.0, 1.0, 7)
    linear, angular = differences(at, q)
    model, _ = at(q, 1)
    np.testing.assert_allclose(model.Jv_WT, linear, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(model.Jw_WT, angular, rtol=0.0, atol=1e-8)
    assert np.abs(arm.kinematics(q).Jv_WT - linear).max() > 1e-2  # the uncorrected one is found out


def test_placing_does_not_correct(arm):
    q = np.full(7, 0.4)
    model = new_seen(arm, dt_s=0.001, has_trocar=False).elsewhere
    model.corrected, model.p_NT[:], model.R_NT[:] = 1, 0.01, np.eye(3)
    place(model, q)
    assert not model.p_WT.any()
    np.testing.assert_array_equal(arm.scene.tip_site, model.site)
