"""`contact: yield`: under a measured contact force the tip gives way along it, and nothing else does."""

from dataclasses import replace

import numpy as np
import pytest

from surgsim.control.rcm import rcm_kinematics
from surgsim.control.torque_laws.rcm_elastic_dynamics import RcmElasticDynamicsConfig
from surgsim.control.torque_laws.rcm_inverse_dynamics import RcmInverseDynamicsConfig


@pytest.fixture
def at_rest(arm, torque_problem):
    """Factory of arms at rest where they should be, the shaft in the trocar."""

    def make(seed):
        p, zero3, zero7 = torque_problem(seed), np.zeros(3), np.zeros(7)
        p_WC = p.kin.p_WT - 0.2 * p.kin.R_WT[:, 2]
        return replace(
            p,
            v=zero7,
            dyn=arm.dynamics(p.q, zero7),
            p_WC=p_WC,
            v_WC=zero3,
            rcm=rcm_kinematics(p.kin, p_WC, zero3),
            command=replace(p.command, p_WTd=p.kin.p_WT, v_WTd=zero3, a_WTd=zero3),
            resolution=replace(p.resolution, qdot=zero7),
            q_ref=p.q,
        )

    return make


def _acceleration(arm, problem, config, f_T):
    """Joint acceleration (7,) of an arm on whose tip `f_T` really acts and is measured.

    What its joints bear holds it at rest, as the law for elastic drives takes it for at first.
    """
    law = config.build(arm)
    p = replace(problem, f_T=f_T, tau_measured=problem.dyn.bias - f_T @ problem.kin.Jv_WT)
    terms, _ = law.torque(p, law.start(p))
    assert not terms[5].any(), "a limit was met"
    outside = f_T @ p.kin.Jv_WT - p.dyn.bias - arm.damping * p.v
    return np.linalg.solve(p.dyn.mass_matrix, terms.sum(axis=0) + outside)


def _mobility(p):
    """Tip mobility (3, 3) with the shaft held, by the constrained inverse of the mass matrix."""
    inverse, J = np.linalg.inv(p.dyn.mass_matrix), p.rcm.jacobian
    held = inverse - inverse @ J.T @ np.linalg.inv(J @ inverse @ J.T) @ J @ inverse
    return p.kin.Jv_WT @ held @ p.kin.Jv_WT.T


@pytest.mark.parametrize("config", [RcmInverseDynamicsConfig, RcmElasticDynamicsConfig])
@pytest.mark.parametrize("seed", range(4))
def test_the_tip_accelerates_along_the_force_by_its_own_mobility_and_the_shaft_stays(
    arm, at_rest, seed, config
):
    p = at_rest(seed)
    force = 0.5 * np.random.default_rng(seed).standard_normal(3)
    law = config(contact="yield")
    change = _acceleration(arm, p, law, force) - _acceleration(arm, p, law, np.zeros(3))
    along = force @ _mobility(p) @ force / (force @ force)
    assert along > 0.01
    np.testing.assert_allclose(p.kin.Jv_WT @ change, along * force, atol=1e-8)
    np.testing.assert_allclose(p.rcm.jacobian @ change, 0.0, atol=1e-8)


def test_without_it_an_unexpected_force_turns_the_shaft(arm, at_rest):
    """What the cancelled share is for: the first tick of `reject`, before the observer has seen the force."""
    p, force = at_rest(1), np.array([0.5, -0.3, 0.4])
    law = RcmInverseDynamicsConfig(contact="reject")
    change = _acceleration(arm, p, law, force) - _acceleration(arm, p, law, np.zeros(3))
    assert np.abs(p.rcm.jacobian @ change).max() > 0.01
