"""RCM error, Jacobians and bias acceleration against finite differences along moving arms and trocars."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surgsim.control.manipulability import velocity_product_accelerations
from surgsim.control.rcm import rcm_bias_acceleration, rcm_cross_form, rcm_kinematics
from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.spatial import shaft_distance

seeds = pytest.mark.parametrize("seed", range(4))


class Motion:
    """q(t) = q + v t + a t^2 / 2 and C(t) = C + V t: independent values of the error along it."""

    def __init__(self, arm, p, seed):
        rng = np.random.default_rng(seed + 50)
        self.arm, self.q, self.C = arm, p.q, p.p_WC
        self.v, self.a, self.V = rng.standard_normal(7), rng.standard_normal(7), 0.1 * rng.standard_normal(3)

    def at(self, t):
        kin = self.arm.kinematics(self.q + self.v * t + 0.5 * self.a * t * t)
        return kin.p_WT - self.C - self.V * t, kin.R_WT[:, 2]

    def error(self, t):
        r, d = self.at(t)
        return r - d * (d @ r)

    def rate(self, f, h=1e-6):
        return (f(h) - f(-h)) / (2 * h)


@pytest.fixture
def motion(arm, velocity_problem, seed):
    return Motion(arm, velocity_problem(seed, rcm_error_m=0.01), seed)


@seeds
def test_rate_of_the_error_with_arm_and_trocar_moving(arm, motion):
    m = motion
    rcm = rcm_kinematics(arm.kinematics(m.q), m.C, m.V)
    rate = rcm.jacobian @ m.v - rcm.trocar_velocity
    np.testing.assert_allclose(rate, rcm.normals @ m.rate(m.error), atol=1e-8)
    squared = m.rate(lambda t: m.error(t) @ m.error(t))
    assert 2 * rcm.error @ rate == pytest.approx(squared, abs=1e-9)
    assert abs(squared) > 1e-5
    np.testing.assert_allclose(rcm.error, rcm.normals @ m.error(0.0), atol=1e-15)


@seeds
def test_second_derivative_of_the_error(arm, motion):
    m, h = motion, 1e-4
    kin = arm.kinematics(m.q)
    rcm = rcm_kinematics(kin, m.C, m.V)
    second = rcm.normals @ (m.error(h) - 2 * m.error(0.0) + m.error(-h)) / h**2
    bias = rcm_bias_acceleration(kin, m.v, m.C, m.V, *velocity_product_accelerations(kin, m.v))
    np.testing.assert_allclose(rcm.jacobian @ m.a + bias, second, atol=1e-5)
    assert np.linalg.norm(bias) > 0.01


@seeds
def test_cross_form_is_eq_2_and_its_jacobian_the_derivative(arm, motion):
    m = motion
    m.V = np.zeros(3)

    def literal(t):
        tip, d = m.at(t)
        wrist = tip - 0.3 * d  # both relative to the trocar
        return np.cross(-wrist, tip - wrist) / 0.3

    E, J = rcm_cross_form(arm.kinematics(m.q), m.C)
    np.testing.assert_allclose(E, literal(0.0), atol=1e-14)
    np.testing.assert_allclose(J @ m.v, m.rate(literal), atol=1e-8)


@seeds
def test_cross_form_has_rank_2_on_the_constraint_and_spans_the_two_normal_rows(velocity_problem, seed):
    p = velocity_problem(seed, rcm_error_m=0.0)
    J = rcm_cross_form(p.kin, p.p_WC)[1]
    sizes = np.linalg.svd(J, compute_uv=False)
    assert sizes[1] > 0.05
    assert sizes[2] < 1e-12
    assert np.linalg.matrix_rank(np.vstack([J, p.rcm.jacobian]), tol=1e-9) == 2
    np.testing.assert_allclose(J.T @ J, p.rcm.jacobian.T @ p.rcm.jacobian, atol=1e-12)


@seeds
def test_all_forms_have_the_distance_from_point_to_line_as_norm(velocity_problem, seed):
    p = velocity_problem(seed, rcm_error_m=0.004)
    d, tip = p.kin.R_WT[:, 2], p.kin.p_WT
    along = np.linalg.lstsq(d[:, None], p.p_WC - tip, rcond=None)[0][0]
    distance = np.linalg.norm(tip + along * d - p.p_WC)
    assert distance == pytest.approx(0.004)
    assert p.rcm.depth == pytest.approx(-along)
    assert np.linalg.norm(p.rcm.error) == pytest.approx(distance)
    assert np.linalg.norm(rcm_cross_form(p.kin, p.p_WC)[0]) == pytest.approx(distance)
    assert shaft_distance(p.p_WC, tip, tip - 0.4 * d) == pytest.approx(distance)


@given(st.integers(0, 1000), st.floats(-0.4, 0.6), st.floats(0.0, 0.1), st.floats(0.0, 6.28))
@settings(deadline=None)
def test_error_is_zero_exactly_when_the_shaft_passes_through_the_trocar(
    arm, velocity_problem, seed, depth, distance, angle
):
    kin = velocity_problem(seed).kin
    on_shaft = kin.p_WT - depth * kin.R_WT[:, 2]
    beside = on_shaft + distance * kin.R_WT @ [np.cos(angle), np.sin(angle), 0.0]
    rcm = rcm_kinematics(kin, beside, np.zeros(3))
    assert np.linalg.norm(rcm.error) == pytest.approx(distance, abs=1e-15)
    assert np.linalg.norm(rcm_cross_form(kin, beside)[0]) == pytest.approx(distance, abs=1e-15)
    assert rcm.depth == pytest.approx(depth, abs=1e-14)


@given(
    st.integers(0, 1000),
    st.lists(st.floats(-2, 2), min_size=3, max_size=3),
    st.floats(-3.1, 3.1),
)
@settings(max_examples=20, deadline=None)
def test_results_do_not_depend_on_the_world_frame(arm, velocity_problem, seed, place, yaw):
    p = velocity_problem(seed)
    robot = RobotConfig(name="lwr4plus", base_position_m=tuple(place), base_yaw_rad=yaw)
    moved = ArmModel(SceneConfig(robot=robot))
    c, s = np.cos(yaw), np.sin(yaw)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    V = np.array([0.1, -0.2, 0.05])
    v = np.linspace(-1.0, 1.0, 7)
    p_WC = np.array(place) + R @ p.p_WC
    here = rcm_kinematics(p.kin, p.p_WC, V)
    kin = moved.kinematics(p.q)
    there = rcm_kinematics(kin, p_WC, R @ V)
    for name in ("error", "jacobian", "trocar_velocity", "depth"):
        np.testing.assert_allclose(getattr(there, name), getattr(here, name), atol=1e-12)
    for_bias = [(kin, p_WC, R @ V), (p.kin, p.p_WC, V)]
    moved_bias, bias = (
        rcm_bias_acceleration(k, v, C, v_WC, *velocity_product_accelerations(k, v)) for k, C, v_WC in for_bias
    )
    np.testing.assert_allclose(moved_bias, bias, atol=1e-10)
