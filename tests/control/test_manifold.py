"""Kernels of the self-motion manifold: derivatives against differences, the Newton step by its order."""

import numpy as np
import pytest

from surgsim.control.manifold import (
    Manifold,
    climb,
    fill_constraints,
    fill_curvature,
    improve,
    project,
)
from surgsim.control.manipulability import (
    fill_chain_slope,
    fill_gradient_slope,
    fill_weighted_columns,
    log_manipulability_gradient,
)
from surgsim.control.rcm import rcm_kinematics
from surgsim.tick.algebra import null_space
from surgsim.tick.arrays import Model, new
from surgsim.tick.nominal import kinematics

seeds = pytest.mark.parametrize("seed", range(4))
trocars = pytest.mark.parametrize("trocar", [True, False])


@pytest.fixture(scope="module")
def model(arm):
    record = new(Model, 7)
    arm.point(record)
    return record


def _manifold(arm, kin, trocar):
    """The manifold through a configuration."""
    p_WC = kin.p_WT - 0.2 * kin.R_WT[:, 2] if trocar else np.full(3, np.nan)
    rows, limits = 5 if trocar else 3, arm.limits
    return Manifold(rows=rows, p_WT=kin.p_WT, p_WC=p_WC, low=limits.q_min, high=limits.q_max)


def _rows(kin, on):
    if on.rows == 3:
        return kin.Jv_WT
    return np.vstack([kin.Jv_WT, rcm_kinematics(kin, on.p_WC, np.zeros(3)).jacobian])


@seeds
def test_slopes_of_chain_and_gradient_are_those_of_differences(arm, random_q, seed):
    rng = np.random.default_rng(seed)
    q, way, h = random_q(rng), rng.normal(size=7), 1e-6
    before, here, after = (arm.kinematics(q + s * way) for s in (-h, 0.0, h))
    J, B, dJ, dz = (np.empty((7, 3)) for _ in range(4))
    tip, slope = np.empty((2, 3)), np.empty(7)
    assert fill_weighted_columns(here.Jv_WT, J, B)
    fill_chain_slope(J, here.z_W, way, dJ, dz, tip)
    fill_gradient_slope(J, here.z_W, B, dJ, dz, slope)
    np.testing.assert_allclose(dJ.T, (after.Jv_WT - before.Jv_WT) / (2 * h), atol=1e-8)
    np.testing.assert_allclose(dz, (after.z_W - before.z_W) / (2 * h), atol=1e-8)
    np.testing.assert_allclose(tip[0], (after.p_WT - before.p_WT) / (2 * h), atol=1e-8)
    np.testing.assert_allclose(tip[1], here.Jw_WT @ way, atol=1e-12)
    gradients = [log_manipulability_gradient(kin.Jv_WT, kin.z_W) for kin in (before, after)]
    expected = (gradients[1] - gradients[0]) / (2 * h)
    np.testing.assert_allclose(slope, expected, atol=1e-7 * abs(expected).max())
    assert abs(slope).max() > 0.1


@seeds
@trocars
def test_curvature_is_that_of_the_lagrangian(arm, model, random_q, seed, trocar):
    q, h = random_q(np.random.default_rng(seed)), 1e-5
    here = arm.kinematics(q)
    on = _manifold(arm, here, trocar)
    J, r, columns, B = np.empty((on.rows, 7)), np.empty(on.rows), np.empty((7, 3)), np.empty((7, 3))
    kinematics(model, q)
    fill_constraints(model, on, J, r)
    np.testing.assert_allclose(J, _rows(here, on), atol=1e-14)
    assert fill_weighted_columns(model.Jv_WT, columns, B)
    multiplier = np.linalg.lstsq(J.T, log_manipulability_gradient(here.Jv_WT, here.z_W))[0]
    Z, C = np.empty((7 - on.rows, 7)), np.empty((7 - on.rows, 7 - on.rows))
    null_space(J, Z)
    fill_curvature(model, on, columns, B, Z, multiplier, C)

    def lagrangian(x):
        kin = arm.kinematics(x)
        return log_manipulability_gradient(kin.Jv_WT, kin.z_W) - _rows(kin, on).T @ multiplier

    slopes = np.array([(lagrangian(q + h * z) - lagrangian(q - h * z)) / (2 * h) for z in Z])
    expected = -Z @ slopes.T
    np.testing.assert_allclose(C, 0.5 * (expected + expected.T), atol=1e-7 * max(1.0, abs(expected).max()))


@seeds
def test_a_step_ends_nearer_to_the_optimum_by_the_square(arm, model, random_q, seed):
    top = random_q(np.random.default_rng(seed))
    on = _manifold(arm, arm.kinematics(top), True)
    on = on._replace(low=np.full(7, -np.inf), high=np.full(7, np.inf))
    assert climb(model, on, top, 60, 1e-9)[0]
    kinematics(model, top)
    J, Z = np.empty((5, 7)), np.empty((2, 7))
    fill_constraints(model, on, J, np.empty(5))
    null_space(J, Z)
    swivel = Z.T @ Z @ np.r_[np.ones(6), 0.0]
    left = []
    for away in (0.04, 0.02):
        q, step = top + away * swivel / np.linalg.norm(swivel), np.empty(7)
        assert project(model, on, q, 8)[1] < 1e-10
        began = np.linalg.norm(q - top)
        assert improve(model, on, q, 1.0, step)
        q += step
        project(model, on, q, 8)
        left.append(np.linalg.norm(q - top))
        assert left[-1] < 0.3 * began
    assert left[1] < 0.35 * left[0]
