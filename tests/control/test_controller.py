"""The controller between resolver and torque law: its reference, where it looks, its memory."""

import numpy as np
import pytest

from surgsim.control.controller import Controller
from surgsim.errors import SurgsimError
from surgsim.plant.state import State
from surgsim.scenario.load import load_controller
from surgsim.tasks.base import TipCommand

DT = 0.001


@pytest.fixture(scope="module")
def config():
    return load_controller("vprnn")


@pytest.fixture
def at(velocity_problem):
    """State and command of a random problem, at a tick."""

    def make(tick=0, seed=0, dt_s=DT, **changes):
        p = velocity_problem(seed)
        state = {
            "q": p.q,
            "v": np.zeros(7),
            "tau": np.zeros(7),
            "p_WC": p.p_WC,
            "v_WC": np.zeros(3),
            **changes,
        }
        return State(t_s=tick * dt_s, **state), p.command

    return make


def _controller(config, arm, *, dt_s=DT, law=True, trocar=True, **changes):
    changed = config.model_copy(update=changes)
    return Controller(changed, arm, dt_s=dt_s, has_trocar=trocar, use_torque_law=law)


def test_reference_starts_at_the_first_state_and_integrates_the_resolver_s_velocities(arm, config, at):
    controller = _controller(config, arm)
    expected = at()[0].q
    for tick in range(20):
        output = controller.tick(*at(tick))
        np.testing.assert_allclose(output.q_ref, expected, atol=1e-15)
        expected = expected + DT * output.resolution.qdot
    assert np.abs(expected - at()[0].q).max() > 1e-4


def test_reference_stays_inside_the_joint_limits(arm, config, at):
    controller = _controller(config, arm, dt_s=0.1)
    far = TipCommand(p_WTd=at()[1].p_WTd + np.array([0, 0, 1.0]), v_WTd=np.zeros(3), a_WTd=np.zeros(3))
    for tick in range(200):  # the measured state never moves, so the reference runs away
        output = controller.tick(at(tick, dt_s=0.1)[0], far)
        assert (output.q_ref >= arm.limits.q_min).all()
        assert (output.q_ref <= arm.limits.q_max).all()
    assert np.isin(output.q_ref, [arm.limits.q_min, arm.limits.q_max]).any()


@pytest.mark.parametrize(("where", "follows"), [("measured", True), ("reference", False)])
def test_the_resolver_looks_at_the_measured_joints_or_at_the_reference(arm, config, at, where, follows):
    def second_answer(offset):
        controller = _controller(config, arm, evaluate_at=where)
        first = controller.tick(*at(0))
        state, command = at(1)
        return controller.tick(at(1, q=state.q + offset)[0], command).resolution.qdot - first.resolution.qdot

    moved = np.abs(second_answer(0.01) - second_answer(0.0)).max()
    assert (moved > 1e-4) == follows


def test_the_torque_law_always_looks_at_the_measured_joints(arm, config, at):
    state, command = at(0)
    output = _controller(config, arm, evaluate_at="reference").tick(state, command)
    bias = output.terms[_controller(config, arm).terms.index("bias")]
    np.testing.assert_allclose(bias, arm.dynamics(state.q, state.v).bias, atol=1e-12)
    np.testing.assert_allclose(output.torque, output.terms.sum(axis=0), atol=1e-12)


def test_after_a_reset_the_same_states_give_the_same_commands(arm, config, at):
    controller = _controller(config, arm)

    def outputs():
        return [controller.tick(*at(tick, seed=1)) for tick in range(5)]

    first = outputs()
    carried_on = outputs()
    controller.reset()
    again = outputs()
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.torque, b.torque)
        np.testing.assert_array_equal(a.resolution.qdot, b.resolution.qdot)
    assert not np.array_equal(first[0].torque, carried_on[0].torque)


def test_without_a_torque_law_there_are_no_terms(arm, config, at):
    controller = _controller(config, arm, law=False)
    output = controller.tick(*at(0))
    assert controller.terms == ()
    assert output.terms.shape == (0, 7)
    np.testing.assert_array_equal(output.torque, 0.0)


def test_without_a_trocar_only_the_tip_is_controlled(arm, config, at):
    state, command = at(0, p_WC=np.full(3, np.nan), v_WC=np.full(3, np.nan))
    controller = _controller(config, arm, trocar=False)
    output = controller.tick(state, command)
    assert np.isfinite(output.torque).all()
    np.testing.assert_array_equal(output.terms[controller.terms.index("rcm")], 0.0)


def test_an_unknown_controller_is_refused():
    with pytest.raises(SurgsimError, match=r"'vprn' is not a shipped controller.*Did you mean 'vprnn'"):
        load_controller("vprn")
