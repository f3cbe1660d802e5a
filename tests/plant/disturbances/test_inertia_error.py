"""Inertia error: the links' share of M(q) and of gravity times the factor, armature and tool as they are."""

import numpy as np
import pytest

from surgsim.plant.disturbances.inertia_error import InertiaErrorConfig

ARMATURE = 0.1  # of assets/robots/lwr4plus
seeds = pytest.mark.parametrize("seed", range(3))


@seeds
@pytest.mark.parametrize("factor", [0.8, 1.0, 1.1, 2.0])
def test_of_the_bare_arm_all_but_the_armature_scales(disturbed, random_q, seed, factor):
    q = random_q(np.random.default_rng(seed))
    plain, _ = disturbed.scene_of(instrument=False)
    heavy, _ = disturbed.scene_of(InertiaErrorConfig(factor=factor), instrument=False)
    A = np.diag(plain.model.dof_armature)
    (M, g), (M_heavy, g_heavy) = disturbed.inertia(plain, q), disturbed.inertia(heavy, q)
    np.testing.assert_allclose(M_heavy - A, factor * (M - A), atol=1e-9)
    np.testing.assert_allclose(g_heavy, factor * g, atol=1e-9)
    np.testing.assert_array_equal(heavy.model.dof_armature, plain.model.dof_armature)
    assert (plain.model.dof_armature > 0).all()


@seeds
def test_the_instrument_is_not_scaled(disturbed, random_q, seed):
    q = random_q(np.random.default_rng(seed))

    def added(instrument):
        plain, _ = disturbed.scene_of(instrument=instrument)
        heavy, _ = disturbed.scene_of(InertiaErrorConfig(factor=1.5), instrument=instrument)
        return disturbed.inertia(heavy, q)[0] - disturbed.inertia(plain, q)[0]

    np.testing.assert_allclose(added(True), added(False), atol=1e-9)


def test_centres_of_mass_stay(disturbed):
    plain, _ = disturbed.scene_of()
    heavy, _ = disturbed.scene_of(InertiaErrorConfig(factor=2.0))
    np.testing.assert_allclose(heavy.model.body_ipos, plain.model.body_ipos, atol=1e-12)


def test_each_link_s_error_is_drawn_within_the_spread_from_the_seed(disturbed):
    plain, _ = disturbed.scene_of()
    links = [f"link{i}" for i in range(1, 8)]

    def factors(seed):
        scene, _ = disturbed.scene_of(InertiaErrorConfig(factor=1.2, spread=0.5), seed=seed)
        ratios = [scene.model.body(name).mass[0] / plain.model.body(name).mass[0] for name in links]
        inertias = [scene.model.body(name).inertia / plain.model.body(name).inertia for name in links]
        np.testing.assert_allclose(inertias, np.tile(ratios, (3, 1)).T)
        return ratios

    drawn = np.array([factors(seed) for seed in range(10)])
    assert drawn.min() >= 1.1
    assert drawn.max() <= 1.3
    assert np.unique(drawn).size == 70
    np.testing.assert_array_equal(factors(4), drawn[4])
