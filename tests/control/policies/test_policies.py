"""Policies: their names, when they are asked, and what resolver and torque law make of them."""

import sys
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from usual_arm import usual_arm

from surgsim.control.controller import ControllerConfig
from surgsim.control.failure import ControlFailure
from surgsim.control.policies import registry
from surgsim.control.policies.observation import observe
from surgsim.control.policies.registry import find_policy, offering, policy_names
from surgsim.control.policies.shipped import damping, proportional
from surgsim.control.resolvers.pinv import PinvConfig
from surgsim.control.resolvers.policy import PolicyConfig
from surgsim.control.seen import seen_of_velocity
from surgsim.control.torque_laws.policy import PolicyLawConfig
from surgsim.errors import Outcome, SurgsimError
from surgsim.plugins import Offer
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare
from surgsim.tick import python_part
from surgsim.tick.fields import fields_of


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


def _observation(problem, arm):
    return observe(fields_of(seen_of_velocity(problem, arm)))


@pytest.mark.parametrize("trocar", [True, False])
def test_an_observation_is_what_the_controller_sees(arm, velocity_problem, trocar):
    p = velocity_problem(1, trocar=trocar, t_s=0.25)
    found = _observation(p, arm)
    wanted = {
        "time": [0.25],
        "joint_position": p.q,
        "joint_velocity": p.v,
        "tip_position": p.kin.p_WT,
        "tip_error": p.kin.p_WT - p.command.p_WTd,
        "command_velocity": p.command.v_WTd,
        "command_acceleration": p.command.a_WTd,
    }
    if trocar:
        wanted["rcm_error"], wanted["insertion_depth"] = p.rcm.error, [p.rcm.depth]
        wanted["trocar_position"], wanted["trocar_velocity"] = p.p_WC, p.v_WC
    assert list(found) == list(wanted)
    for name, value in wanted.items():
        np.testing.assert_array_equal(found[name], value)


def test_an_observation_holds_copies(arm, velocity_problem):
    seen = seen_of_velocity(velocity_problem(1), arm)
    before = seen.copy()
    for value in observe(fields_of(seen)).values():
        value[:] = np.nan
    assert seen.tobytes() == before.tobytes()


class Counting:
    """A policy that counts its calls, and forgets them at a reset."""

    def __init__(self):
        self.calls = 0

    def reset(self):
        self.calls = 0

    def __call__(self, observation):
        self.calls += 1
        return [float(self.calls), 0.0, 0.0]


@pytest.mark.parametrize("decimation", [1, 3])
def test_a_policy_is_asked_once_in_a_while_and_reset_at_the_start(
    arm, velocity_problem, register, decimation
):
    register("counting", Counting())
    config = PolicyConfig(name="counting", tip_speed_max_m_per_s=2.5, decimation=decimation)
    resolver, problem = config.build(arm), velocity_problem(0)
    for _ in range(2):
        memory, actions = resolver.start(problem), []
        for _ in range(9):
            answer, memory = resolver.step(problem, memory)
            actions.append(answer.command.v_WTd[0])
        wanted = [min(1.0 + k // decimation, 2.5) for k in range(9)]  # cut at the limit
        assert actions == wanted


class Entries:
    """Counts how often Python is entered from compiled code within the block."""

    def __enter__(self):
        self.count = 0
        sys.setprofile(self._look)
        return self

    def __exit__(self, *_):
        sys.setprofile(None)

    def _look(self, frame, event, _):
        self.count += event == "call" and frame.f_code.co_filename == python_part.__file__


@pytest.mark.parametrize(
    "parts",
    [
        {"resolver": {"type": "policy", "decimation": 7}, "torque_law": {"type": "joint_impedance"}},
        {
            "resolver": {"type": "policy", "name": "damping", "action": "joint_velocity", "decimation": 7},
            "torque_law": {"type": "joint_impedance"},
        },
        {"resolver": {"type": "pinv"}, "torque_law": {"type": "policy", "decimation": 7}},
    ],
    ids=["tip velocity", "joint velocity", "torque"],
)
def test_python_is_entered_when_the_policy_is_due_and_not_while_its_action_holds(parts):
    config = ControllerConfig.model_validate({"name": "asked", **parts})
    simulation = Simulation(prepare(load_scenario("circle_panda", controller=config)))
    for ticks, due in ((1, 1), (6, 0), (1, 1), (3, 0), (25, 4)):
        with Entries() as entries:
            simulation.advance(ticks)
        assert entries.count == due
    assert not simulation.ended


@pytest.mark.parametrize(
    ("action", "text"),
    [
        (1.0, r"\(\), not \(3,\)"),
        (np.zeros(2), r"\(2,\), not \(3,\)"),
        ([[0.0] * 3], r"\(1, 3\), not \(3,\)"),
    ],
)
def test_an_action_must_have_its_shape(arm, velocity_problem, register, action, text):
    register("p", lambda _: action)
    with pytest.raises(SurgsimError, match=rf"policy 'p' gave an action of shape {text}"):
        PolicyConfig(name="p").build(arm).step(velocity_problem(0), None)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_an_action_must_be_finite(arm, velocity_problem, register, bad):
    register("p", lambda _: [1.0, bad, 0.0])
    with pytest.raises(ControlFailure, match=r"policy 'p' gave .*not finite") as caught:
        PolicyConfig(name="p").build(arm).step(velocity_problem(0), None)
    assert caught.value.outcome is Outcome.DIVERGED


def test_a_huge_action_is_cut_at_the_limit(arm, velocity_problem, register):
    register("p", lambda _: [1e200, -1e200, 0.0])
    answer, _ = PolicyConfig(name="p").build(arm).step(velocity_problem(0), None)
    np.testing.assert_array_equal(answer.command.v_WTd, [0.1, -0.1, 0.0])


def test_the_controller_s_time_has_that_of_the_policy_in_it(scenario, register):
    """At least what the policy takes, in the ticks in which it is asked; every tick is timed."""

    def busy(observation):
        until = time.thread_time() + 0.002
        while time.thread_time() < until:
            pass
        return np.zeros(3)

    register("busy", busy)
    asked = ("controller.resolver.name=busy", "controller.resolver.decimation=5", "task.duration_s=0.2")
    took = simulate(scenario(*asked, controller="policy_proportional"))["control_time_s"]
    assert np.isfinite(took).all()
    assert (took[::5] >= 0.002).all()


def test_a_tip_velocity_is_resolved_from_a_moving_reference(arm, velocity_problem):
    """Two steps of the resolver are two steps of the inner one with the command made by hand."""
    resolver = PolicyConfig().build(arm)
    inner = PinvConfig().build(usual_arm())
    first = velocity_problem(2)
    v = proportional(_observation(first, arm))
    memory = resolver.start(first)
    p_ref = first.kin.p_WT
    for problem in (first, velocity_problem(3)):
        v = proportional(_observation(problem, arm))
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
