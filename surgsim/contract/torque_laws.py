"""What every torque law promises, on each arm that has the redundancy that it needs."""

from dataclasses import replace
from typing import Any

import numpy as np

from surgsim.array import Array
from surgsim.contract.arms import arm_of, cases, on_every_arm
from surgsim.contract.check import Check, require
from surgsim.contract.problems import DT, torque_problem
from surgsim.control.torque_laws.base import TorqueProblem
from surgsim.models.config import SceneConfig


def _rows(law: Any, problem: TorqueProblem) -> Array:
    """Terms (3, terms, n) at three ticks from a start [N m]."""
    memory, rows = law.start(problem), []
    for k in range(3):
        terms, memory = law.torque(replace(problem, t_s=problem.t_s + k * DT), memory)
        rows.append(np.array(terms))
    return np.array(rows)


def _leaves_it_to_the_arm(law: Any) -> bool:
    """Whether the law's torque is added to that of the arm's own impedance loop."""
    return bool(getattr(law, "commands_reference", False))


@on_every_arm
def finite(config: Any, scene: SceneConfig) -> None:
    """A finite row for every term, with and without a trocar, the same each time."""
    arm, part = arm_of(scene), config()
    for trocar in cases(part, arm):
        for seed in range(3):
            problem = torque_problem(arm, seed, trocar=trocar)
            law = part.build(arm)
            require(len(set(law.terms)) == len(law.terms) > 0, f"terms are none or named twice: {law.terms}")
            first, shape = _rows(law, problem), (3, len(law.terms), problem.q.size)
            require(
                first.shape == shape, f"the terms of three ticks have the shape {first.shape}, not {shape}"
            )
            require(np.isfinite(first).all(), "a term is not finite")
            given = np.abs(first.sum(axis=1)).max()
            require(_leaves_it_to_the_arm(law) or given > 1e-3, "the torque is nought")
            require(np.array_equal(_rows(law, problem), first), "the same problem gives other torques again")
            new = _rows(config().build(arm), problem)
            require(np.array_equal(new, first), "a new object gives other torques")


@on_every_arm
def rest(config: Any, scene: SceneConfig) -> None:
    """With no error and at rest, what is left is gravity; nothing where the arm's own loop sees to that."""
    arm = arm_of(scene)
    p, zero = torque_problem(arm, 4, trocar=False), np.zeros(3)
    still = np.zeros_like(p.q)
    dyn = arm.dynamics(p.q, still)
    p = replace(
        p,
        v=still,
        dyn=dyn,
        tau_measured=dyn.bias,
        command=replace(p.command, p_WTd=p.kin.p_WT, v_WTd=zero, a_WTd=zero),
        resolution=replace(p.resolution, qdot=still),
        q_ref=p.q,
    )
    law = config().build(arm)
    terms, _ = law.torque(p, law.start(p))
    wanted = np.zeros_like(dyn.bias) if _leaves_it_to_the_arm(law) else dyn.bias
    apart = np.abs(np.asarray(terms).sum(axis=0) - wanted).max()
    require(apart <= 1e-9, f"an arm at rest without error is given {apart:.3g} N m beside gravity")


CHECKS = (
    Check(name="a finite row for every term, the same each time", run=finite),
    Check(name="an arm that is where it should be is held against gravity alone", run=rest),
)
