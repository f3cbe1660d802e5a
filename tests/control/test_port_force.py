"""The forces at two places of the shaft from one wrench, against the forces that it was made of."""

import numpy as np
import pytest

from surgsim.control.port_force import LEAST_LEVER_M, split_wrench
from surgsim.control.seen import new_seen


def _seen(arm, rng, depth, sideways=0.0):
    """A shaft whose tip is `depth` below the port."""
    seen = new_seen(arm, dt_s=0.001, has_trocar=True)
    kin = arm.kinematics(arm.limits.q_min + rng.uniform(0.3, 0.7, 7) * (arm.limits.q_max - arm.limits.q_min))
    seen.p_WT[:], seen.R_WT[:], seen.p_WS[:] = kin.p_WT, kin.R_WT, kin.p_WS
    seen.p_WC[:] = kin.p_WT - depth * kin.R_WT[:, 2] + sideways * kin.R_WT[:, 0]
    return seen


def _lateral(seen, force):
    z = seen.R_WT[:, 2]
    return force - (force @ z) * z


@pytest.mark.parametrize("hand", [0.0, 0.35, 0.5])
@pytest.mark.parametrize("seed", range(5))
def test_two_forces_are_told_apart(arm, hand, seed):
    rng = np.random.default_rng(seed)
    seen = _seen(arm, rng, rng.uniform(0.05, 0.25), sideways=0.003)
    z = seen.R_WT[:, 2]
    depth = float(z @ (seen.p_WT - seen.p_WC))
    wall, other = rng.normal(size=3), rng.normal(size=3)
    seen.f_S[:] = wall + other
    seen.m_S[:] = np.cross(-depth * z, wall) + np.cross(-hand * z, other)
    port, rest = np.zeros(3), np.zeros(3)
    assert split_wrench(seen, hand, port, rest)
    np.testing.assert_allclose(port, _lateral(seen, wall), atol=1e-12)
    np.testing.assert_allclose(rest, _lateral(seen, other), atol=1e-12)


def test_places_that_are_too_near_are_not_told_apart(arm):
    rng = np.random.default_rng(0)
    port, rest = np.ones(3), np.ones(3)
    seen = _seen(arm, rng, 0.5 * LEAST_LEVER_M)
    seen.f_S[:] = 1.0
    assert not split_wrench(seen, 0.0, port, rest)
    assert not port.any()
    assert not rest.any()
