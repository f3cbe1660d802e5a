"""The port's sphere, walls and zones as rows, against differences of the distances that they bound."""

import numpy as np
import pytest
from pydantic import ValidationError
from usual_arm import random_q, usual_arm, velocity_problem

from surgsim.control.barriers import entry_curvature, fill_entry_barrier, fill_plane_barriers
from surgsim.control.planes import PlaneConfig, plane_numbers
from surgsim.control.seen import seen_of_velocity
from surgsim.control.zones import ZoneConfig, fill_entry_row, fill_zone_rows, zone_numbers
from surgsim.tick.arrays import Model, new
from surgsim.tick.nominal import dynamics, kinematics

seeds = pytest.mark.parametrize("seed", range(3))
N = 7


def path(rng):
    """Joints and a port that move along parabolas: q, q', q'' and the port's, at a time."""
    arm = usual_arm()
    q, v, acceleration = random_q(rng), 0.3 * rng.standard_normal(N), rng.standard_normal(N)
    kin = arm.kinematics(q)
    port = kin.p_WT - 0.2 * kin.R_WT[:, 2] + 0.01 * rng.standard_normal(3)
    v_WC, a_WC = 0.05 * rng.standard_normal(3), rng.standard_normal(3)

    def at(t):
        return (
            arm.kinematics(q + v * t + 0.5 * acceleration * t * t),
            port + v_WC * t + 0.5 * a_WC * t * t,
        )

    return at, (q, v, acceleration), (port, v_WC, a_WC)


def squared_distance(kin, point):
    """Of a point from the shaft's line, by the cross product."""
    turned = np.cross(point - kin.p_WT, kin.R_WT[:, 2])
    return turned @ turned


def placed(q, v):
    """The nominal model as a record."""
    model = new(Model, N)
    usual_arm().point(model, shared=True)
    kinematics(model, q)
    dynamics(model, v)
    return model


def derivatives(f, h=1e-4):
    """Value, first and second derivative at 0 by central differences."""
    low, middle, high = f(-h), f(0.0), f(h)
    return middle, (high - low) / (2.0 * h), (high - 2.0 * middle + low) / h**2


@seeds
def test_the_sphere_s_derivatives_are_those_of_the_squared_distance(seed):
    at, (q, v, acceleration), (port, v_WC, a_WC) = path(np.random.default_rng(seed))
    row = np.empty(N)
    D, slope, bend = entry_curvature(placed(q, v), v, port, v_WC, a_WC, row)
    value, first, second = derivatives(lambda t: squared_distance(*at(t)))
    assert pytest.approx(value, rel=1e-9) == D
    assert slope == pytest.approx(first, rel=1e-5)
    assert bend + row @ acceleration == pytest.approx(second, rel=1e-4)
    assert abs(second - bend) > 1e-4  # the accelerations count


@seeds
def test_the_second_order_row_keeps_its_inequality_with_equality_at_its_bound(seed):
    """H'' + (p1 + p2) h' + p1 p2 h = most - row q'', of the port as it will be some milliseconds later."""
    at, (q, v, acceleration), (port, v_WC, a_WC) = path(np.random.default_rng(seed))
    late, radius, poles, row = 0.004, 0.02, np.array([20.0, 100.0]), np.empty(N)
    p = velocity_problem(seed)
    seen = seen_of_velocity(p, usual_arm())
    seen.p_WC[:] = port - late * v_WC + 0.5 * late**2 * a_WC
    seen.v_WC[:], seen.a_WC[:] = v_WC - late * a_WC, a_WC
    most = fill_entry_barrier(seen, placed(q, v), late, radius, poles, row)
    h, first, second = derivatives(lambda t: radius**2 - squared_distance(*at(t)))
    wanted = second + poles.sum() * first + poles.prod() * h
    assert most - row @ acceleration == pytest.approx(wanted, rel=1e-4, abs=1e-5)


@seeds
def test_the_walls_rows_are_those_of_their_distances(seed):
    at, (q, v, acceleration), _ = path(np.random.default_rng(seed))
    poles, rows, most = np.array([5.0, 30.0]), np.empty((2, N)), np.empty(2)
    walls = [
        PlaneConfig(normal=(0.0, 3.0, 4.0), offset_m=0.4),
        PlaneConfig(normal=(-1.0, 0.0, 0.0), offset_m=0.1),
    ]
    fill_plane_barriers(plane_numbers(walls), placed(q, v), poles, rows, most)
    for k, normal in enumerate(([0.0, 0.6, 0.8], [-1.0, 0.0, 0.0])):
        offset = walls[k].offset_m
        room = derivatives(lambda t, n=normal, o=offset: o - n @ at(t)[0].p_WT)
        wanted = room[2] + 35.0 * room[1] + 150.0 * room[0]
        assert most[k] - rows[k] @ acceleration == pytest.approx(wanted, rel=1e-5)


def gradient(f, q, h=1e-6):
    return np.array([(f(q + h * e) - f(q - h * e)) / (2.0 * h) for e in np.eye(N)])


@seeds
def test_the_entry_row_is_the_gradient_of_the_squared_distance(seed):
    p, eta, radius, row = velocity_problem(seed, rcm_error_m=0.003), 3.0, 0.005, np.empty(N)
    bound = fill_entry_row(radius, eta, seen_of_velocity(p, usual_arm()), row)

    def D(q):
        return squared_distance(usual_arm().kinematics(q), p.p_WC)

    np.testing.assert_allclose(row, gradient(D, p.q), rtol=1e-6, atol=1e-9)
    h = 1e-5
    kin = usual_arm().kinematics(p.q)
    zeta = (squared_distance(kin, p.p_WC + h * p.v_WC) - squared_distance(kin, p.p_WC - h * p.v_WC)) / (2 * h)
    assert bound == pytest.approx(eta * (radius**2 - 0.003**2) - zeta, rel=1e-6)


def line_distance(p, z, point, u):
    """Of two lines, by their common normal."""
    normal = np.cross(z, u)
    return (p - point) @ normal / np.linalg.norm(normal)


SQUARED = {
    ("shaft", False): lambda kin, point, u: squared_distance(kin, point),
    ("shaft", True): lambda kin, point, u: line_distance(kin.p_WT, kin.R_WT[:, 2], point, u) ** 2,
    ("tip", False): lambda kin, point, u: (kin.p_WT - point) @ (kin.p_WT - point),
    ("tip", True): lambda kin, point, u: np.cross(kin.p_WT - point, u) @ np.cross(kin.p_WT - point, u),
}


@seeds
@pytest.mark.parametrize(("of", "line"), sorted(SQUARED))
@pytest.mark.parametrize("keep", ["inside", "outside"])
def test_a_zone_s_row_is_the_gradient_of_the_squared_distance(seed, of, line, keep):
    rng = np.random.default_rng(seed)
    p, arm, eta = velocity_problem(seed), usual_arm(), 4.0
    u = rng.standard_normal(3)
    u /= np.linalg.norm(u)
    point = p.kin.p_WT + 0.05 * rng.standard_normal(3)
    zone = ZoneConfig(
        of=of, keep=keep, point_m=tuple(point), direction=tuple(2.0 * u) if line else None, radius_m=0.03
    )
    G, most = np.empty((1, N)), np.empty(1)
    fill_zone_rows(zone_numbers([zone]), eta, seen_of_velocity(p, arm), G, most)
    sign = 1.0 if keep == "inside" else -1.0

    def D(q):
        return SQUARED[of, line](arm.kinematics(q), point, u)

    np.testing.assert_allclose(G[0], sign * gradient(D, p.q), rtol=1e-5, atol=1e-8)
    assert most[0] == pytest.approx(sign * eta * (0.03**2 - D(p.q)), rel=1e-9)


def test_of_a_cylinder_along_the_shaft_the_tip_is_as_near_as_any_point():
    p = velocity_problem(0)
    z = p.kin.R_WT[:, 2]
    across = p.kin.R_WT[:, 0]
    zone = ZoneConfig(point_m=tuple(p.kin.p_WT + 0.04 * across), direction=tuple(z), radius_m=0.03)
    G, most = np.empty((1, N)), np.empty(1)
    fill_zone_rows(zone_numbers([zone]), 1.0, seen_of_velocity(p, usual_arm()), G, most)
    assert most[0] == pytest.approx(0.04**2 - 0.03**2)
    np.testing.assert_allclose(G[0], 2.0 * 0.04 * across @ p.kin.Jv_WT, atol=1e-12)


def test_a_direction_of_no_length_is_refused():
    with pytest.raises(ValidationError, match="direction must not be zero"):
        ZoneConfig(point_m=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 0.0), radius_m=0.1)
