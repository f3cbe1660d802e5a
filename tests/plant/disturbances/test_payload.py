"""Payload: the weight and the inertia of a small sphere on the shaft axis, from geometry alone."""

import numpy as np
import pytest

from surgsim.plant.disturbances.payload import PayloadConfig

seeds = pytest.mark.parametrize("seed", range(3))


def _point_jacobian(kin, p):
    """Columns z_i x (p - a_i), and z_i."""
    return np.cross(kin.z_W, p - kin.anchors_W).T, kin.z_W.T


@seeds
@pytest.mark.parametrize(("mass", "distance"), [(0.2, 0.04), (1.5, 0.3)])
def test_it_adds_its_weight_and_inertia_where_it_sits(arm, disturbed, random_q, seed, mass, distance):
    q = random_q(np.random.default_rng(seed))
    plain, _ = disturbed.scene_of()
    loaded, _ = disturbed.scene_of(PayloadConfig(mass_kg=mass, distance_m=distance))
    kin = arm.kinematics(q)
    place = kin.p_WT + (distance - 0.44) * kin.R_WT[:, 2]  # the tip is 0.44 m from the flange
    Jv, Jw = _point_jacobian(kin, place)
    (M, g), (M_loaded, g_loaded) = disturbed.inertia(plain, q), disturbed.inertia(loaded, q)
    np.testing.assert_allclose(g_loaded - g, Jv.T @ [0.0, 0.0, mass * 9.81], atol=1e-9)
    radius = (3.0 * mass / (4.0 * np.pi * 1000.0)) ** (1.0 / 3.0)  # of water
    expected = mass * Jv.T @ Jv + 0.4 * mass * radius**2 * Jw.T @ Jw
    np.testing.assert_allclose(M_loaded - M, expected, atol=1e-9)
    assert loaded.model.body_mass.sum() - plain.model.body_mass.sum() == pytest.approx(mass)


def test_the_controller_s_model_does_not_know_it(arm, disturbed, random_q):
    q = random_q(np.random.default_rng(0))
    loaded, _ = disturbed.scene_of(PayloadConfig(mass_kg=5.0))
    bias = arm.dynamics(q, np.zeros(7)).bias
    assert np.abs(disturbed.inertia(loaded, q)[1] - bias).max() > 1.0


def test_its_mass_is_drawn_within_its_spread_from_the_seed(disturbed):
    def mass(seed, spread):
        scene, _ = disturbed.scene_of(PayloadConfig(mass_kg=2.0, spread=spread), seed=seed)
        return scene.model.body("payload").mass[0]

    drawn = [mass(seed, 0.25) for seed in range(30)]
    assert min(drawn) >= 1.5
    assert max(drawn) <= 2.5
    assert np.ptp(drawn) > 0.5
    assert drawn[7] == mass(7, 0.25)
    assert {mass(seed, 0.0) for seed in range(5)} == {2.0}
