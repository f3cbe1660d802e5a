"""The resolver below a policy or another kernel, and whose failure it is that ends a run."""

import gc
from dataclasses import replace

import numpy as np
import pytest

from surgsim.compiled import compiled
from surgsim.control.failure import ControlFailure
from surgsim.control.inside import HEAD_SIZE, resolve_below
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.pinv import PinvConfig
from surgsim.control.resolvers.policy import PolicyConfig
from surgsim.errors import Outcome, SurgsimError
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare
from surgsim.tick.status import RANK_LOST


class PlainPinv:
    """The resolver `pinv` as a Python object that counts its steps in its memory."""

    def __init__(self, arm):
        self._kernel, self.memories = PinvConfig().build(arm), []

    def start(self, problem):
        return 0

    def step(self, problem, memory):
        self.memories.append(memory)
        return self._kernel.step(problem, None)[0], memory + 1


def _over(below, resolver):
    """A policy's resolver over another one."""
    size = resolver.memory_size - resolver.below.memory_size + getattr(below, "memory_size", 0)
    return replace(resolver, below=below, memory_size=size)


def test_a_resolver_in_python_below_a_policy_has_its_memory(arm, velocity_problem):
    kernel = PolicyConfig().build(arm)
    below = PlainPinv(arm)
    plain = _over(below, kernel)
    memory = wanted = None
    for seed in range(4):
        p = velocity_problem(seed)
        before = memory
        answer, memory = plain.step(p, before)
        expected, wanted = kernel.step(p, wanted)
        np.testing.assert_array_equal(answer.qdot, expected.qdot)
        np.testing.assert_array_equal(plain.step(p, before)[0].qdot, expected.qdot)  # and no other one
    assert below.memories == [0, 0, 1, 1, 2, 2, 3, 3]


def test_a_resolver_in_python_below_a_policy_gives_the_same_run(scenario):
    made = scenario("task.duration_s=0.2", controller="policy_proportional")
    setup, expected = prepare(made), simulate(made)
    parts, below = setup.controller.parts, PlainPinv(setup.arm)
    controller = setup.controller.with_parts(replace(parts, resolver=_over(below, parts.resolver)))
    trace = Simulation(replace(setup, controller=controller)).run()
    assert trace.equals(expected)
    assert below.memories == list(range(len(expected["t_s"])))


@pytest.mark.parametrize(
    ("below", "text", "data"),
    [
        ({"type": "mink"}, "mink found no velocity", {"J", "v"}),
        ({"type": "qp"}, "QP: no joint velocity meets", {"H", "f", "G"}),
    ],
)
def test_a_failure_below_a_policy_is_told_as_without_it(arm, velocity_problem, below, text, data):
    config = PolicyConfig.model_validate({"type": "policy", "resolver": below})
    problem = velocity_problem(0, trocar_speed=50.0)
    with pytest.raises(ControlFailure, match=text) as caught:
        config.build(arm).step(problem, None)
    assert caught.value.outcome is Outcome.INFEASIBLE
    assert data <= caught.value.data.keys()


class Failing:
    """A policy that raises one after the other, at its second action and the following, and then stands."""

    def __init__(self, *errors):
        self._errors = [None, *errors]

    def __call__(self, observation):
        error = self._errors.pop(0) if self._errors else None
        if error is not None:
            raise error
        return np.zeros(3)


GIVES_UP = ControlFailure(Outcome.INFEASIBLE, "I give up")


def test_what_a_policy_raises_is_raised_by_the_run(scenario, register):
    register("failing", Failing(ValueError("no more")))
    with pytest.raises(ValueError, match=r"^no more$"):
        simulate(scenario("controller.resolver.name=failing", controller="policy_proportional"))


@pytest.mark.parametrize("bridged", [0, 3])
def test_a_policy_that_gives_up_ends_the_run_or_is_bridged(scenario, register, bridged):
    register("failing", Failing(GIVES_UP))
    limit = f"safety.infeasible_ticks_max={bridged}"
    trace = simulate(scenario("controller.resolver.name=failing", limit, controller="policy_proportional"))
    ending = trace.meta.ending
    assert ending.outcome is (Outcome.COMPLETED if bridged else Outcome.INFEASIBLE)
    assert ending.detail == ("" if bridged else "I give up")
    assert trace["infeasible"].sum() == 1.0


def test_the_reason_of_a_run_s_end_is_not_that_of_a_tick_before(scenario, register):
    """A tick that was bridged leaves an error behind in the resolver below; the policy then fails."""

    class GivesUpOnce(PlainPinv):
        def step(self, problem, memory):
            if not self.memories:
                self.memories.append(memory)
                raise GIVES_UP
            return super().step(problem, memory)

    register("failing", Failing(KeyError("mine")))
    made = scenario(
        "controller.resolver.name=failing",
        "safety.infeasible_ticks_max=3",
        controller="policy_proportional",
    )
    setup = prepare(made)
    parts, below = setup.controller.parts, GivesUpOnce(setup.arm)
    controller = setup.controller.with_parts(replace(parts, resolver=_over(below, parts.resolver)))
    with pytest.raises(KeyError, match="mine"):
        Simulation(replace(setup, controller=controller)).run()


@compiled
def hand_on(gains, seen, memory, out):
    return resolve_below(gains, seen, memory, out)


@compiled
def give_up(gains, seen, memory, out):
    return RANK_LOST


def _kernel_over_pinv(kernel, arm, **more):
    below, head = PinvConfig().build(arm), np.zeros(HEAD_SIZE)
    size = below.memory_size
    return KernelResolver(kernel=kernel, arm=arm, gains=head, memory_size=size, below=below, **more)


def test_a_snapshot_holds_no_address_of_the_resolver_below(scenario):
    made = scenario("task.duration_s=0.2", controller="pinv")

    def simulation():
        setup = prepare(made)
        parts = replace(setup.controller.parts, resolver=_kernel_over_pinv(hand_on, setup.arm))
        return Simulation(replace(setup, controller=setup.controller.with_parts(parts)))

    first = simulation()
    first.advance(100)
    taken = first.snapshot()
    assert "resolver_gains" not in taken.arrays
    del first
    gc.collect()
    other = simulation()
    other.restore(taken)
    assert other.run().equals(simulate(made))


def test_a_kernel_says_itself_why_it_gave_up(arm, velocity_problem):
    told = _kernel_over_pinv(give_up, arm, failures={RANK_LOST: "of its own accord"})
    with pytest.raises(ControlFailure, match="of its own accord"):
        told.step(velocity_problem(0), None)
    silent = _kernel_over_pinv(give_up, arm)
    with pytest.raises(ControlFailure, match=r"rank|Jacobian"):
        silent.step(velocity_problem(0), None)


def test_a_scenario_that_the_resolver_below_does_not_fit_is_refused(scenario):
    over = "controller.resolver={{type: policy, action: {}, resolver: {{type: hands_on}}}}"
    with pytest.raises(SurgsimError, match="'hands_on' needs the disturbance force_torque_sensor"):
        scenario(over.format("tip_velocity"))
    assert scenario(over.format("joint_velocity")).controller  # the resolver is not asked
