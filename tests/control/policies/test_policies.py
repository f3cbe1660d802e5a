"""Policies: their names, when they are asked, and what resolver and torque law make of them."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from usual_arm import usual_arm

from surgsim.control.failure import ControlFailure
from surgsim.control.policies import registry
from surgsim.control.policies.asking import Asker
from surgsim.control.policies.observation import observe
from surgsim.control.policies.registry import find_policy, offering, policy_names, register_policy
from surgsim.control.policies.shipped import damping, proportional
from surgsim.control.resolvers.pinv import PinvConfig
from surgsim.control.resolvers.policy import PolicyConfig
from surgsim.control.torque_laws.policy import PolicyLawConfig
from surgsim.errors import Outcome, SurgsimError
from surgsim.plugins import Offer
from surgsim.simulate.loop import simulate


@pytest.fixture
def register(monkeypatch):
    """`register_policy`, undone after the test."""
    monkeypatch.setattr(registry, "_registered", {})
    return register_policy


def test_shipped_policies_are_found_by_name():
    assert find_policy("proportional") is proportional
    assert find_policy("damping") is damping
    assert policy_names() == ["damping", "proportional"]


def test_a_registered_policy_is_found_and_can_be_replaced(register):
    register("mine", damping)
    register("mine", proportional)
    assert find_policy("mine") is proportional
    assert "mine" in policy_names()


@pytest.mark.parametrize(
    ("name", "policy", "text"),
    [
        ("proportional", damping, "policy 'proportional' is installed already"),
        ("mine", 3, "cannot be called: it is 3"),
    ],
)
def test_what_cannot_be_registered_is_refused(register, name, policy, text):
    with pytest.raises(SurgsimError, match=text):
        register(name, policy)


def test_an_unknown_name_is_refused_with_the_known_ones_and_a_way_out():
    text = (
        r"'proportinal' is not a policy\. Known: damping, proportional\. Did you mean 'proportional'\? "
        r"A policy that was registered in one process is not known to another: give it an entry point "
        r"of the group 'surgsim\.policies'\."
    )
    with pytest.raises(SurgsimError, match=text):
        find_policy("proportinal")


def test_policies_of_other_packages_come_from_entry_points_and_cannot_hide_ours(monkeypatch):
    places = {
        "theirs": "their_policy:act",
        "absent": "their_policy:nothing",
        "number": "math:pi",
        "damping": "math:sin",
    }
    given = {
        name: Offer(group=registry.GROUP, name=name, place=place, package="lab", version="1.0")
        for name, place in places.items()
    }
    monkeypatch.setattr(registry, "offers", lambda group: given)
    monkeypatch.setitem(sys.modules, "their_policy", SimpleNamespace(act=np.negative))
    assert find_policy("theirs") is np.negative
    assert find_policy("damping") is damping
    with pytest.raises(SurgsimError, match=r"policy 'absent' of the package lab 1\.0 does not load"):
        find_policy("absent")
    with pytest.raises(
        SurgsimError, match=r"policy 'number' of the package lab 1\.0 \(math:pi\) cannot be called"
    ):
        find_policy("number")


def test_an_offer_holds_within_its_block_alone():
    with offering("agent", damping):
        assert find_policy("agent") is damping
    with pytest.raises(SurgsimError, match="'agent' is not a policy"):
        find_policy("agent")


def test_an_observation_holds_copies(velocity_problem):
    problem = velocity_problem(1)
    q = problem.q.copy()
    for value in observe(problem).values():
        value[:] = np.nan
    np.testing.assert_array_equal(problem.q, q)
    assert np.isfinite(problem.command.v_WTd).all()
    assert np.isfinite(problem.kin.p_WT).all()


class Counting:
    """Counts its calls, and forgets them at a reset."""

    def __init__(self):
        self.calls = 0

    def reset(self):
        self.calls = 0

    def __call__(self, observation):
        self.calls += 1
        return [float(self.calls), 0.0]


@pytest.mark.parametrize("decimation", [1, 3])
def test_a_policy_is_asked_once_in_a_while_and_reset_at_the_start(velocity_problem, decimation):
    asker = Asker("counting", Counting(), np.array([2.5, 1.0]), decimation)
    problem = velocity_problem(0)
    for _ in range(2):
        asker.start()
        held, actions = None, []
        for _ in range(9):
            held = asker.ask(problem, held)
            actions.append(held.action[0])
        wanted = [min(1.0 + k // decimation, 2.5) for k in range(9)]  # cut at the limit
        assert actions == wanted


def test_an_action_must_have_its_shape_and_be_finite(velocity_problem):
    problem, limit = velocity_problem(0), np.ones(3)
    with pytest.raises(SurgsimError, match=r"policy 'p' gave an action of shape \(\), not \(3,\)"):
        Asker("p", lambda _: 1.0, limit, 1).ask(problem, None)
    with pytest.raises(ControlFailure, match=r"policy 'p' gave .*not finite") as caught:
        Asker("p", lambda _: [1.0, np.inf, 0.0], limit, 1).ask(problem, None)
    assert caught.value.outcome is Outcome.DIVERGED


def test_a_tip_velocity_is_resolved_from_a_moving_reference(arm, velocity_problem):
    """Two steps of the resolver are two steps of the inner one with the command made by hand."""
    resolver = PolicyConfig().build(arm)
    inner = PinvConfig().build(usual_arm())
    first = velocity_problem(2)
    v = proportional(observe(first))
    memory = resolver.start(first)
    p_ref = first.kin.p_WT
    for problem in (first, velocity_problem(3)):
        v = proportional(observe(problem))
        command = replace(problem.command, p_WTd=p_ref, v_WTd=v, a_WTd=np.zeros(3))
        wanted, _ = inner.step(replace(problem, command=command), None)
        answer, memory = resolver.step(problem, memory)
        np.testing.assert_array_equal(answer.qdot, wanted.qdot)
        np.testing.assert_array_equal(answer.command.p_WTd, p_ref)
        np.testing.assert_array_equal(answer.command.v_WTd, v)
        p_ref = p_ref + problem.dt_s * v


def test_joint_velocities_are_cut_at_omega(arm, velocity_problem, random_q, register):
    register("fast", lambda observation: np.full(7, 100.0))
    q = random_q(np.random.default_rng(0))
    q[3] = arm.limits.q_max[3] - 1e-3
    problem = velocity_problem(0, q=q)
    resolver = PolicyConfig(name="fast", action="joint_velocity").build(arm)
    answer, _ = resolver.step(problem, resolver.start(problem))
    np.testing.assert_array_equal(answer.qdot, problem.upper)
    assert answer.qdot[3] == pytest.approx(1e-2)
    np.testing.assert_allclose(answer.command.v_WTd, problem.kin.Jv_WT @ answer.qdot)
    J = np.vstack([problem.kin.Jv_WT, problem.rcm.jacobian])
    rhs = np.concatenate([problem.command.v_WTd, problem.rcm.trocar_velocity])
    assert answer.residual == pytest.approx(np.linalg.norm(J @ answer.qdot - rhs))


@pytest.mark.parametrize("add_bias", [True, False])
def test_torques_are_cut_at_the_limits_and_the_bias_is_apart(arm, torque_problem, register, add_bias):
    register("strong", lambda observation: np.array([1e6, -1e6, 1.0, 2.0, 3.0, 4.0, 5.0]))
    problem, limit = torque_problem(0), arm.limits.torque
    law = PolicyLawConfig(name="strong", add_bias=add_bias).build(arm)
    terms, _ = law.torque(problem, law.start(problem))
    np.testing.assert_array_equal(terms[0], [limit[0], -limit[1], 1.0, 2.0, 3.0, 4.0, 5.0])
    np.testing.assert_array_equal(terms[1], problem.dyn.bias if add_bias else np.zeros(7))


def test_the_torque_law_follows_the_policy_and_not_the_task(scenario, register):
    """A policy that stays where it is is not pulled along the path by the impedance of the tip."""
    register("still", lambda observation: np.zeros(3))
    made = scenario("controller.resolver.name=still", controller="policy_proportional")
    trace = simulate(made)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert np.ptp(trace.block("tip"), axis=0).max() < 1e-5
    assert trace["tip_error_m"].max() > 3e-3


def test_a_torque_policy_runs_as_a_controller(scenario):
    made = scenario("controller.torque_law={type: policy}")
    trace = simulate(made)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert np.abs(trace.block("v")).max() < 1e-9


def test_a_policy_without_a_name_that_is_known_does_not_start(scenario):
    with pytest.raises(SurgsimError, match="'nobody' is not a policy"):
        simulate(scenario("controller.resolver.name=nobody", controller="policy_proportional"))
