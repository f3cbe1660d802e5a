"""Passivity controllers and the mapping, against independently written formulas."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from surgsim.teleop import mapping as mappings
from surgsim.teleop.mapping import Mapping, MappingConfig, align, feedback_force, rotation_matrix
from surgsim.teleop.passivity_control import (
    PassivityControlConfig,
    PassivityLaw,
    PortEnergy,
    admittance_control,
    compensate_drift,
    coordinating_force,
    impedance_control,
    keep_lead,
    observe,
    observed,
)
from surgsim.tick.arrays import new
from surgsim.tick.overlay import take

T = 0.001
VECTOR = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda a: np.linalg.norm(a) > 0.05)
WXYZ = (0.8, 0.0, 0.6, 0.0)


def limits(**keys):
    law = new(PassivityLaw, 0)
    take(law, PassivityControlConfig(**keys))
    return law


FREE = limits(damping_limit_ns_per_m=1e9, mobility_limit_m_per_ns=1e9)


def port(**energies):
    state = new(PortEnergy, 0)
    for name, energy in energies.items():
        state[name] = energy
    return state


def controlled(control, state, effort, flow, law):
    out = np.zeros(3)
    control(law, state, effort, flow, T, out)
    return out


@settings(max_examples=100, deadline=None)
@given(force=VECTOR, velocity=VECTOR, level=st.floats(-1e-3, 1e-3))
def test_after_control_the_observer_is_not_negative(force, velocity, level):
    for control, effort, flow in (
        (impedance_control, force, velocity),
        (admittance_control, velocity, force),
    ):
        state = port(received_j=max(level, 0.0), out_j=max(-level, 0.0))
        changed = controlled(control, state, effort, flow, FREE)
        burnt = T * float((effort - changed) @ flow)
        before = observed(state)
        observe(state, T * float(effort @ flow), burnt, 0.0)
        assert observed(state) >= -1e-12
        if before - max(T * float(effort @ flow), 0.0) >= 0.0:
            assert np.array_equal(changed, effort)


def test_the_damper_is_the_published_one():
    state = port(out_j=2e-3)
    force, velocity = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.5, 0.0])
    beta = 2e-3 / (T * 0.25)
    found = controlled(impedance_control, state, force, velocity, FREE)
    assert found == pytest.approx(force - beta * velocity)


def test_a_debt_above_the_limit_is_carried_over():
    state = port(out_j=1.0)
    limited = limits(damping_limit_ns_per_m=10.0)
    velocity, zero = np.array([0.1, 0.0, 0.0]), np.zeros(3)
    found = controlled(impedance_control, state, zero, velocity, limited)
    assert found == pytest.approx(-10.0 * velocity)
    assert controlled(impedance_control, state, velocity, zero, limited) == pytest.approx(velocity)


def test_the_coordinating_force_is_that_of_the_coupling_and_its_reference_keeps_near():
    rng = np.random.default_rng(0)
    law = limits(coupling_stiffness_n_per_m=300.0, coupling_damping_ns_per_m=7.0, coupling_lead_m=0.5)
    for _ in range(50):
        x_d, x, v_d, v = rng.normal(size=(4, 3))
        lead = (x_d - x) * min(1.0, 0.5 / np.linalg.norm(x_d - x))
        found = np.zeros(3)
        keep_lead(law, x_d, x)
        coordinating_force(law, x_d, x, v_d, v, found)
        assert x_d == pytest.approx(x + lead)
        assert found == pytest.approx(300.0 * lead + 7.0 * (v_d - v))


@settings(max_examples=100, deadline=None)
@given(pull=VECTOR, force=VECTOR, velocity=VECTOR, level=st.floats(-1e-3, 1e-3))
def test_drift_is_compensated_as_far_as_the_received_energy_pays(pull, force, velocity, level):
    state, moved = port(received_j=max(level, 0.0), out_j=max(-level, 0.0)), velocity.copy()
    compensate_drift(state, pull, force, T, 0.5, moved)
    added, most = moved - velocity, pull * min(1.0, 0.5 / np.linalg.norm(pull))
    left = max(level - T * max(force @ velocity, 0.0), 0.0)
    cost = T * float(force @ most)
    assert added == pytest.approx(most if cost <= left else most * left / cost, abs=1e-12)
    assert T * float(force @ added) <= left + 1e-12


class Mapped:
    """The kernels of the mapping, each with its answer returned."""

    def __init__(self):
        self.law = new(Mapping, 0)
        align(self.law, MappingConfig(scale=0.4, rotation_wxyz=WXYZ), [0.43, 0.0, 0.68], [0.1, 0.5, 0.2])

    def __getattr__(self, name):
        def call(*given):
            out = np.zeros(3)
            getattr(mappings, name)(self.law, *given, out)
            return out

        return call


def test_rotation_against_scipy():
    quaternion = Rotation.random(rng=np.random.default_rng(0)).as_quat()
    expected = Rotation.from_quat(quaternion).as_matrix()
    assert rotation_matrix(quaternion[[3, 0, 1, 2]]) == pytest.approx(expected)


def test_mapping_is_inverted_and_its_motion_is_its_derivative():
    m, rng = Mapped(), np.random.default_rng(1)
    p, v, h = rng.normal(size=3), rng.normal(size=3), 1e-6
    assert m.to_console(m.to_remote(p)) == pytest.approx(p)
    assert m.motion_to_console(m.motion_to_remote(v)) == pytest.approx(v)
    assert (m.to_remote(p + h * v) - m.to_remote(p - h * v)) / (2 * h) == pytest.approx(m.motion_to_remote(v))
    assert m.to_remote(m.law.home_O) == pytest.approx(m.law.home_W)
    assert np.linalg.norm(m.motion_to_remote(v)) == pytest.approx(0.4 * np.linalg.norm(v))


def test_force_law_is_a_spring_towards_where_the_tip_is():
    m = Mapped()
    lag = np.array([0.01, -0.02, 0.0])
    force = np.zeros(3)
    feedback_force(m.law, m.law.home_O + lag, m.law.home_W, 60.0, force)
    assert force == pytest.approx(-60.0 * lag)


def test_a_quaternion_that_is_none_is_refused():
    with pytest.raises(ValidationError, match="norm 1"):
        MappingConfig(rotation_wxyz=(1.0, 1.0, 0.0, 0.0))
