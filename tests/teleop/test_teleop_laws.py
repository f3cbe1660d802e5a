"""Passivity controllers and the mapping, against independently written formulas."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from surgsim.teleop.mapping import Mapping, MappingConfig, feedback_force, rotation_matrix
from surgsim.teleop.passivity_control import (
    PassivityControlConfig,
    PortState,
    admittance_control,
    impedance_control,
    observe,
)

T = 0.001
FREE = PassivityControlConfig(damping_limit_ns_per_m=1e9, mobility_limit_m_per_ns=1e9)
VECTOR = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda a: np.linalg.norm(a) > 0.05)
WXYZ = (0.8, 0.0, 0.6, 0.0)


@settings(max_examples=100, deadline=None)
@given(force=VECTOR, velocity=VECTOR, observed=st.floats(-1e-3, 1e-3))
def test_after_control_the_observer_is_not_negative(force, velocity, observed):
    state = PortState(received_j=max(observed, 0.0), out_j=max(-observed, 0.0))
    for control, effort, flow in (
        (impedance_control, force, velocity),
        (admittance_control, velocity, force),
    ):
        changed = control(state, effort, flow, T, FREE)
        burnt = T * float((effort - changed) @ flow)
        after = observe(state, T * float(effort @ flow), burnt, 0.0)
        assert after.observed_j >= -1e-12
        if state.observed_j - max(T * float(effort @ flow), 0.0) >= 0.0:
            assert np.array_equal(changed, effort)


def test_the_damper_is_the_published_one():
    state = PortState(out_j=2e-3)
    force, velocity = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.5, 0.0])
    beta = 2e-3 / (T * 0.25)
    assert impedance_control(state, force, velocity, T, FREE) == pytest.approx(force - beta * velocity)


def test_a_debt_above_the_limit_is_carried_over():
    state = PortState(out_j=1.0)
    limited = PassivityControlConfig(damping_limit_ns_per_m=10.0)
    velocity = np.array([0.1, 0.0, 0.0])
    assert impedance_control(state, np.zeros(3), velocity, T, limited) == pytest.approx(-10.0 * velocity)
    assert impedance_control(state, velocity, np.zeros(3), T, limited) == pytest.approx(velocity)


def mapping():
    config = MappingConfig(scale=0.4, rotation_wxyz=WXYZ)
    return Mapping.aligned(config, [0.43, 0.0, 0.68], [0.1, 0.5, 0.2])


def test_rotation_against_scipy():
    quaternion = Rotation.random(rng=np.random.default_rng(0)).as_quat()
    expected = Rotation.from_quat(quaternion).as_matrix()
    assert rotation_matrix(quaternion[[3, 0, 1, 2]]) == pytest.approx(expected)


def test_mapping_is_inverted_and_its_motion_is_its_derivative():
    m, rng = mapping(), np.random.default_rng(1)
    p, v, h = rng.normal(size=3), rng.normal(size=3), 1e-6
    assert m.to_console(m.to_remote(p)) == pytest.approx(p)
    assert m.motion_to_console(m.motion_to_remote(v)) == pytest.approx(v)
    assert (m.to_remote(p + h * v) - m.to_remote(p - h * v)) / (2 * h) == pytest.approx(m.motion_to_remote(v))
    assert m.to_remote(m.home_O) == pytest.approx(m.home_W)
    assert np.linalg.norm(m.motion_to_remote(v)) == pytest.approx(0.4 * np.linalg.norm(v))


def test_force_law_is_a_spring_towards_where_the_tip_is():
    m = mapping()
    lag = np.array([0.01, -0.02, 0.0])
    force = feedback_force(m, m.home_O + lag, m.home_W, 60.0)
    assert force == pytest.approx(-60.0 * lag)


def test_a_quaternion_that_is_none_is_refused():
    with pytest.raises(ValidationError, match="norm 1"):
        MappingConfig(rotation_wxyz=(1.0, 1.0, 0.0, 0.0))
