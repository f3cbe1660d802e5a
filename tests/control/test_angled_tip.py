"""The shaft's line and an angled tip: kinematics and rows against MuJoCo alone and differences."""

import mink
import numpy as np
import pytest
from angled import OwnKinematics, angled_arm
from usual_arm import usual_arm

from surgsim.contract.problems import random_q
from surgsim.control.barriers import entry_curvature
from surgsim.control.manifold import Manifold, fill_constraints, fill_curvature
from surgsim.control.manipulability import fill_weighted_columns, log_manipulability_gradient
from surgsim.control.mink_tasks import RcmTask
from surgsim.control.port_force import split_wrench
from surgsim.control.rcm import rcm_cross_form, rcm_kinematics
from surgsim.control.seen import fill_kinematics, new_seen
from surgsim.control.torque_laws.rcm_hierarchy import fill_task_errors
from surgsim.control.zones import ZoneConfig, fill_zone_rows, zone_numbers
from surgsim.tick.algebra import null_space
from surgsim.tick.arrays import Model, new
from surgsim.tick.nominal import dynamics, kinematics

seeds = pytest.mark.parametrize("seed", range(3))
N, ZERO = 7, np.zeros(3)


@pytest.fixture(scope="module")
def arm():
    return angled_arm()


@pytest.fixture(scope="module")
def own():
    return OwnKinematics()


def posture(arm, seed, off_m=0.01):
    """Joint positions and a port beside the shaft, 0.2 m behind its end."""
    rng = np.random.default_rng(seed)
    q = random_q(arm, rng)
    kin = arm.kinematics(q)
    return q, kin.p_WS - 0.2 * kin.R_WT[:, 2] + off_m * rng.standard_normal(3), rng


def placed(arm, q, v=None, correction=None):
    model = new(Model, N)
    arm.point(model)
    if correction is not None:
        model.corrected, model.p_NT[:], model.R_NT[:] = 1, *correction
    kinematics(model, q)
    if v is not None:
        dynamics(model, v)
    return model


def differences(f, q, h=1e-6):
    """d f / dq, a column for each joint."""
    return np.stack([(f(q + h * e) - f(q - h * e)) / (2 * h) for e in np.eye(len(q))], axis=-1)


@seeds
def test_tip_and_shaft_are_where_the_two_files_have_them(arm, own, seed):
    q, p_WC, _ = posture(arm, seed)
    entry, end, tip = own.points(q)
    for kin in (arm.kinematics(q), placed(arm, q)):
        np.testing.assert_allclose(kin.p_WT, tip, atol=1e-12)
        np.testing.assert_allclose(kin.p_WS, end, atol=1e-12)
        np.testing.assert_allclose(kin.R_WT[:, 2], (end - entry) / np.linalg.norm(end - entry), atol=1e-12)
        np.testing.assert_allclose(kin.p_WT + kin.R_WT @ arm.p_TA, entry, atol=1e-12)
        np.testing.assert_allclose(kin.Jv_WT, differences(lambda x: own.points(x)[2], q), atol=1e-8)
        np.testing.assert_allclose(kin.Jv_WS, differences(lambda x: own.points(x)[1], q), atol=1e-8)
    rcm = rcm_kinematics(arm.kinematics(q), p_WC, ZERO)
    assert np.linalg.norm(rcm.error) == pytest.approx(own.distance(q, p_WC), abs=1e-12)
    assert rcm.depth == pytest.approx((end - p_WC) @ (end - entry) / np.linalg.norm(end - entry), abs=1e-12)


def test_a_straight_instrument_ends_at_its_tip():
    arm = usual_arm()
    kin = arm.kinematics(posture(arm, 0)[0])
    assert not arm.is_angled
    assert not arm.p_TS.any()
    np.testing.assert_array_equal(kin.p_WS, kin.p_WT)
    np.testing.assert_array_equal(kin.Jv_WS, kin.Jv_WT)


@seeds
def test_the_rcm_jacobian_is_that_of_differences(arm, own, seed):
    q, p_WC, _ = posture(arm, seed)
    kin = arm.kinematics(q)
    rcm = rcm_kinematics(kin, p_WC, ZERO)

    def error(x):
        entry, end, _ = own.points(x)
        axis, off = (end - entry) / np.linalg.norm(end - entry), end - p_WC
        return off - (off @ axis) * axis

    def crossed(x):
        entry, end, _ = own.points(x)
        return np.cross((end - entry) / np.linalg.norm(end - entry), end - p_WC)

    np.testing.assert_allclose(rcm.jacobian, rcm.normals @ differences(error, q), atol=1e-8)
    value, jacobian = rcm_cross_form(kin, p_WC)
    np.testing.assert_allclose(value, crossed(q), atol=1e-12)
    np.testing.assert_allclose(jacobian, differences(crossed, q), atol=1e-8)
    task, configuration = (
        RcmTask(arm.scene.shaft_end_site, N),
        mink.Configuration(arm.scene.model, q=q),
    )
    task.target = p_WC
    np.testing.assert_allclose(task.compute_error(configuration), rcm.error, atol=1e-12)
    np.testing.assert_allclose(task.compute_jacobian(configuration), rcm.jacobian, atol=1e-12)


@seeds
def test_a_corrected_tip_takes_the_shaft_s_end_with_it(arm, seed):
    """The end is rigidly fixed to the corrected tip, and its Jacobian is that of the corrected place."""
    q, _, rng = posture(arm, seed)
    w = 0.01 * rng.standard_normal(3)
    turn = np.array([[1, -w[2], w[1]], [w[2], 1, -w[0]], [-w[1], w[0], 1]])
    correction = (
        0.003 * rng.standard_normal(3),
        np.linalg.qr(turn)[0] * np.sign(np.diag(np.linalg.qr(turn)[1])),
    )
    model = placed(arm, q, correction=correction)
    np.testing.assert_allclose(model.R_WT.T @ (model.p_WS - model.p_WT), arm.p_TS, atol=1e-14)
    found = model.Jv_WS.copy()
    place = lambda x: placed(arm, x, correction=correction).p_WS.copy()  # noqa: E731
    np.testing.assert_allclose(found, differences(place, q), atol=1e-8)


@seeds
def test_errors_of_second_order_laws_are_derivatives(arm, own, seed):
    q, p_WC, rng = posture(arm, seed)
    v, h = 0.3 * rng.standard_normal(N), 1e-4
    seen = new_seen(arm, dt_s=0.001, has_trocar=True)
    seen.p_WC[:] = p_WC
    J, error, rate, bias = np.empty((5, N)), np.empty(5), np.empty(5), np.empty(5)
    fill_task_errors(seen, placed(arm, q, v), 0.0, 0.0, J, error, rate, bias)
    R = arm.kinematics(q).R_WT

    def at(t):
        entry, end, tip = own.points(q + t * v)
        axis, off = (end - entry) / np.linalg.norm(end - entry), end - p_WC
        return np.concatenate((tip, R[:, :2].T @ (off - (off @ axis) * axis)))

    low, middle, high = at(-h), at(0.0), at(h)
    np.testing.assert_allclose(error, middle, atol=1e-12)
    np.testing.assert_allclose(rate, (high - low) / (2 * h), atol=1e-7)
    np.testing.assert_allclose(J @ v, rate, atol=1e-12)
    np.testing.assert_allclose(bias, (high - 2 * middle + low) / h**2, atol=1e-6)


@seeds
def test_the_sphere_at_the_port_is_about_the_shaft_s_line(arm, own, seed):
    q, p_WC, rng = posture(arm, seed)
    v, h, row = 0.3 * rng.standard_normal(N), 1e-4, np.empty(N)
    D, slope, bend = entry_curvature(placed(arm, q, v), v, p_WC, ZERO, ZERO, row)
    square = lambda x: own.distance(x, p_WC) ** 2  # noqa: E731
    low, middle, high = (square(q + t * v) for t in (-h, 0.0, h))
    assert square(q) == pytest.approx(D, abs=1e-14)
    assert slope == pytest.approx((high - low) / (2 * h), abs=1e-8)
    assert bend == pytest.approx((high - 2 * middle + low) / h**2, rel=1e-4, abs=1e-7)
    np.testing.assert_allclose(row, differences(square, q), atol=1e-8)


@seeds
@pytest.mark.parametrize("of", ["shaft", "tip"])
def test_a_zone_is_kept_by_the_shaft_s_line_or_by_the_tip(arm, own, seed, of):
    q, point, _ = posture(arm, seed, off_m=0.05)
    seen = new_seen(arm, dt_s=0.001, has_trocar=True)
    fill_kinematics(seen, arm.kinematics(q))
    G, most = np.empty((1, N)), np.empty(1)
    zone = ZoneConfig(of=of, keep="inside", point_m=tuple(point), radius_m=0.03)
    fill_zone_rows(zone_numbers([zone]), 4.0, seen, G, most)

    def square(x):
        return own.distance(x, point) ** 2 if of == "shaft" else np.sum((own.points(x)[2] - point) ** 2)

    assert most[0] == pytest.approx(4.0 * (0.03**2 - square(q)), abs=1e-12)
    np.testing.assert_allclose(G[0], differences(square, q), atol=1e-8)


@seeds
def test_the_manifold_s_curvature_is_that_of_the_lagrangian(arm, seed):
    q, p_WC, _ = posture(arm, seed, off_m=0.0)
    here, limits, h = arm.kinematics(q), arm.limits, 1e-5
    on = Manifold(rows=5, p_WT=here.p_WT, p_WC=p_WC, low=limits.q_min, high=limits.q_max)
    model = placed(arm, q)
    J, r, columns, B = np.empty((5, N)), np.empty(5), np.empty((N, 3)), np.empty((N, 3))
    fill_constraints(model, on, J, r)
    assert np.abs(r).max() < 1e-12

    def rows(kin):
        return np.vstack([kin.Jv_WT, rcm_kinematics(kin, p_WC, ZERO).jacobian])

    def lagrangian(x):
        kin = arm.kinematics(x)
        return log_manipulability_gradient(kin.Jv_WT, kin.z_W) - rows(kin).T @ multiplier

    np.testing.assert_allclose(J, rows(here), atol=1e-12)
    assert fill_weighted_columns(model.Jv_WT, columns, B)
    multiplier = np.linalg.lstsq(J.T, log_manipulability_gradient(here.Jv_WT, here.z_W))[0]
    Z, C = np.empty((2, N)), np.empty((2, 2))
    null_space(J, Z)
    fill_curvature(model, on, columns, B, Z, multiplier, C)
    slopes = np.array([(lagrangian(q + h * z) - lagrangian(q - h * z)) / (2 * h) for z in Z])
    expected = -Z @ slopes.T
    np.testing.assert_allclose(C, 0.5 * (expected + expected.T), atol=1e-7 * max(1.0, abs(expected).max()))


@seeds
def test_a_hand_and_the_port_are_told_apart_by_the_moment_about_the_tip(arm, seed):
    q, p_WC, rng = posture(arm, seed, off_m=0.0)
    seen, kin = new_seen(arm, dt_s=0.001, has_trocar=True), arm.kinematics(q)
    fill_kinematics(seen, kin)
    seen.p_WC[:] = p_WC
    z, wall, hand = kin.R_WT[:, 2], rng.normal(size=3), rng.normal(size=3)
    at_hand = kin.p_WS - 0.35 * z
    seen.f_S[:] = wall + hand
    seen.m_S[:] = np.cross(p_WC - kin.p_WT, wall) + np.cross(at_hand - kin.p_WT, hand)
    port, other = np.zeros(3), np.zeros(3)
    assert split_wrench(seen, 0.35, port, other)
    np.testing.assert_allclose(port, wall - (wall @ z) * z, atol=1e-12)
    np.testing.assert_allclose(other, hand - (hand @ z) * z, atol=1e-12)
    wall -= (wall @ z) * z  # what the seal does along the shaft is not told apart from it
    seen.f_S[:] = wall + hand
    seen.m_S[:] = np.cross(p_WC - kin.p_WT, wall)
    assert split_wrench(seen, 0.0, port, other)
    np.testing.assert_allclose(port, wall, atol=1e-12)
