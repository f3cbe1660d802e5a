"""What every resolver promises, on each arm that has the redundancy that it needs."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from surgsim.contract.arms import arm_of, cases, on_every_arm, scenes
from surgsim.contract.check import Check, require
from surgsim.contract.problems import DT, random_q, velocity_problem
from surgsim.control.failure import ControlFailure
from surgsim.control.problem import Resolution, VelocityProblem
from surgsim.control.redundancy import redundancy_needed
from surgsim.models.arm import ArmModel
from surgsim.models.config import SceneConfig

_ROUNDING = 1e-12


def moving(arm: ArmModel, seed: int, trocar: bool = True, count: int = 5) -> list[VelocityProblem]:
    """An arm at rest that is asked to move from 0.1 s on, with its shaft in a trocar at rest."""
    problem = velocity_problem(arm, seed, trocar=trocar, rcm_error_m=0.0, trocar_speed=0.0)
    problem = replace(problem, v=np.zeros_like(problem.q))
    return [replace(problem, t_s=0.1 + k * DT) for k in range(count)]


def steps(
    resolver: Any, problems: Sequence[VelocityProblem], memory: Any = None
) -> tuple[list[Resolution], Any]:
    """Answers to the problems in turn, and the last memory."""
    memory = resolver.start(problems[0]) if memory is None else memory
    answers = []
    for problem in problems:
        answer, memory = resolver.step(problem, memory)
        answers.append(answer)
    return answers, memory


def _inside(answer: Resolution, problem: VelocityProblem) -> None:
    shape, wanted = np.shape(answer.qdot), problem.q.shape
    require(shape == wanted, f"qdot has the shape {shape}, not {wanted}")
    require(np.isfinite(answer.qdot).all(), f"qdot is not finite: {answer.qdot}")
    beyond = np.maximum(problem.lower - answer.qdot, answer.qdot - problem.upper).max()
    require(beyond <= _ROUNDING, f"qdot is {beyond:.3g} rad/s beyond the bounds")


@on_every_arm
def finite(config: Any, scene: SceneConfig) -> None:
    """With and without a trocar: (n,), finite, inside the bounds, with a residual, not standing still."""
    arm, part = arm_of(scene), config()
    for trocar in cases(part, arm):
        for seed in range(3):
            problems = moving(arm, seed, trocar)
            answers, _ = steps(part.build(arm), problems)
            for problem, answer in zip(problems, answers, strict=True):
                _inside(answer, problem)
                residual = answer.residual
                require(np.isfinite(residual) and residual >= 0.0, f"the residual is {residual}")
            require(np.abs(answers[-1].qdot).max() > 1e-6, "the arm stands still, though it is asked to move")


@on_every_arm
def bounded(config: Any, scene: SceneConfig) -> None:
    """Joints at their limits, tip speeds up to 10 m/s: inside the bounds, or a ControlFailure."""
    arm, part = arm_of(scene), config()
    if True not in cases(part, arm):
        return
    for seed in range(20):
        rng = np.random.default_rng(seed)
        q = random_q(arm, rng)
        joint = rng.integers(q.size)
        q[joint] = arm.limits.q_max[joint] - rng.choice([0.0, 1e-3, 0.05])
        problem = velocity_problem(arm, seed, q=q, speed=10.0 ** rng.uniform(-2, 1), rcm_error_m=0.02)
        resolver = part.build(arm)
        memory = resolver.start(problem)
        try:
            for k in range(3):
                answer, memory = resolver.step(replace(problem, t_s=k * DT), memory)
                _inside(answer, problem)
        except ControlFailure:  # hard rows may be out of reach, and a failure is an answer
            continue


@on_every_arm
def singular(config: Any, scene: SceneConfig) -> None:
    """The stretched arm: finite and within the velocity limits, or a failure."""
    arm, part = arm_of(scene), config()
    for trocar in cases(part, arm):
        upright = np.zeros_like(arm.limits.q_min)
        problem = velocity_problem(arm, 0, trocar=trocar, q=upright)
        resolver = part.build(arm)
        try:
            answer, _ = resolver.step(problem, resolver.start(problem))
        except (ControlFailure, np.linalg.LinAlgError):  # the controller makes an outcome of both
            continue
        require(np.isfinite(answer.qdot).all(), f"qdot is not finite: {answer.qdot}")
        excess = (np.abs(answer.qdot) - arm.limits.velocity).max()
        require(excess <= _ROUNDING, f"qdot is {excess:.3g} rad/s beyond the velocity limits")


def _equal(a: Sequence[Resolution], b: Sequence[Resolution]) -> bool:
    return all(np.array_equal(x.qdot, y.qdot) and x.residual == y.residual for x, y in zip(a, b, strict=True))


@on_every_arm
def deterministic(config: Any, scene: SceneConfig) -> None:
    """The same problems give the same bits, after other problems and in a new object."""
    arm, part = arm_of(scene), config()
    for trocar in cases(part, arm)[:1]:
        problems = moving(arm, 1, trocar)
        resolver = part.build(arm)
        first, _ = steps(resolver, problems)
        steps(resolver, moving(arm, 2, trocar))
        require(_equal(first, steps(resolver, problems)[0]), "after other problems the answers differ")
        require(_equal(first, steps(config().build(arm), problems)[0]), "a new object answers otherwise")


@on_every_arm
def pure(config: Any, scene: SceneConfig) -> None:
    """The same problem and memory give the same answer, and the problem is left as it was."""
    arm, part = arm_of(scene), config()
    for trocar in cases(part, arm)[:1]:
        problems = moving(arm, 1, trocar)
        resolver = part.build(arm)
        _, memory = steps(resolver, problems)
        inputs = (problems[0].q, problems[0].lower, problems[0].command.p_WTd)
        before = [array.copy() for array in inputs]
        first, _ = steps(resolver, problems[:1], memory)
        steps(resolver, moving(arm, 2, trocar))
        again, _ = steps(resolver, problems[:1], memory)
        apart = np.abs(first[0].qdot - again[0].qdot).max()
        require(
            apart <= 1e-9, f"the same problem and memory give answers {apart:.3g} rad/s apart: a hidden state"
        )
        same = all(np.array_equal(a, b) for a, b in zip(before, inputs, strict=True))
        require(same, "the resolver changes the problem that it is given")


def says_its_redundancy(config: Any) -> None:
    """What it needs beside the tasks is a whole number, and an arm of eight joints has it with a trocar."""
    needed = redundancy_needed(config())
    require(needed >= 0, f"needs_redundancy is {needed}")
    most = max(arm_of(scene).redundancy(True) for scene in scenes())
    require(needed <= most, f"needs_redundancy is {needed}; an arm of eight joints has {most} with a trocar")


CHECKS = (
    Check(name="says how much redundancy it needs", run=says_its_redundancy),
    Check(name="answers are finite, inside the bounds, with their residual", run=finite),
    Check(name="answers respect the bounds whatever is asked", run=bounded),
    Check(name="a singular arm gives an answer or an outcome", run=singular),
    Check(name="is deterministic and starts afresh", run=deterministic),
    Check(name="step is a pure function of problem and memory", run=pure),
)
