"""What every resolver promises."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from surgsim.contract.check import Check, require
from surgsim.contract.problems import DT, arm, random_q, velocity_problem
from surgsim.control.failure import ControlFailure
from surgsim.control.problem import Resolution, VelocityProblem

_ROUNDING = 1e-12


def moving(seed: int, trocar: bool = True, count: int = 5) -> list[VelocityProblem]:
    """An arm at rest that is asked to move from 0.1 s on, with its shaft in a trocar at rest."""
    problem = velocity_problem(seed, trocar=trocar, rcm_error_m=0.0, trocar_speed=0.0)
    problem = replace(problem, v=np.zeros(7))
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
    require(np.shape(answer.qdot) == (7,), f"qdot has the shape {np.shape(answer.qdot)}, not (7,)")
    require(np.isfinite(answer.qdot).all(), f"qdot is not finite: {answer.qdot}")
    beyond = np.maximum(problem.lower - answer.qdot, answer.qdot - problem.upper).max()
    require(beyond <= _ROUNDING, f"qdot is {beyond:.3g} rad/s beyond the bounds")


def finite(config: Any) -> None:
    """With and without a trocar: (7,), finite, inside the bounds, with a residual, not standing still."""
    for trocar in (True, False):
        for seed in range(3):
            problems = moving(seed, trocar)
            answers, _ = steps(config().build(arm()), problems)
            for problem, answer in zip(problems, answers, strict=True):
                _inside(answer, problem)
                residual = answer.residual
                require(np.isfinite(residual) and residual >= 0.0, f"the residual is {residual}")
            require(np.abs(answers[-1].qdot).max() > 1e-6, "the arm stands still, though it is asked to move")


def bounded(config: Any) -> None:
    """Joints at their limits, tip speeds up to 10 m/s: inside the bounds, or a ControlFailure."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        q = random_q(rng)
        joint = rng.integers(7)
        q[joint] = arm().limits.q_max[joint] - rng.choice([0.0, 1e-3, 0.05])
        problem = velocity_problem(seed, q=q, speed=10.0 ** rng.uniform(-2, 1), rcm_error_m=0.02)
        resolver = config().build(arm())
        memory = resolver.start(problem)
        try:
            for k in range(3):
                answer, memory = resolver.step(replace(problem, t_s=k * DT), memory)
                _inside(answer, problem)
        except ControlFailure:  # hard rows may be out of reach, and a failure is an answer
            continue


def singular(config: Any) -> None:
    """The stretched arm: finite and within the velocity limits, or a failure."""
    for trocar in (True, False):
        problem = velocity_problem(0, trocar=trocar, q=np.zeros(7))  # standing straight up
        resolver = config().build(arm())
        try:
            answer, _ = resolver.step(problem, resolver.start(problem))
        except (ControlFailure, np.linalg.LinAlgError):  # the controller makes an outcome of both
            continue
        require(np.isfinite(answer.qdot).all(), f"qdot is not finite: {answer.qdot}")
        excess = (np.abs(answer.qdot) - arm().limits.velocity).max()
        require(excess <= _ROUNDING, f"qdot is {excess:.3g} rad/s beyond the velocity limits")


def _equal(a: Sequence[Resolution], b: Sequence[Resolution]) -> bool:
    return all(np.array_equal(x.qdot, y.qdot) and x.residual == y.residual for x, y in zip(a, b, strict=True))


def deterministic(config: Any) -> None:
    """The same problems give the same bits, after other problems and in a new object."""
    problems = moving(1)
    resolver = config().build(arm())
    first, _ = steps(resolver, problems)
    steps(resolver, moving(2))
    require(_equal(first, steps(resolver, problems)[0]), "after other problems the answers differ")
    require(_equal(first, steps(config().build(arm()), problems)[0]), "a new object answers otherwise")


def pure(config: Any) -> None:
    """The same problem and memory give the same answer, and the problem is left as it was."""
    problems = moving(1)
    resolver = config().build(arm())
    _, memory = steps(resolver, problems)
    inputs = (problems[0].q, problems[0].lower, problems[0].command.p_WTd)
    before = [array.copy() for array in inputs]
    first, _ = steps(resolver, problems[:1], memory)
    steps(resolver, moving(2))
    again, _ = steps(resolver, problems[:1], memory)
    apart = np.abs(first[0].qdot - again[0].qdot).max()
    require(
        apart <= 1e-9, f"the same problem and memory give answers {apart:.3g} rad/s apart: a hidden state"
    )
    same = all(np.array_equal(a, b) for a, b in zip(before, inputs, strict=True))
    require(same, "the resolver changes the problem that it is given")


CHECKS = (
    Check(name="answers are finite, inside the bounds, with their residual", run=finite),
    Check(name="answers respect the bounds whatever is asked", run=bounded),
    Check(name="a singular arm gives an answer or an outcome", run=singular),
    Check(name="is deterministic and starts afresh", run=deterministic),
    Check(name="step is a pure function of problem and memory", run=pure),
)
