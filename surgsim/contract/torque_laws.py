"""What every torque law promises."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surgsim.contract.check import Check, require
from surgsim.contract.problems import DT, arm, torque_problem
from surgsim.control.torque_laws.base import TorqueProblem

Array = NDArray[np.float64]


def _rows(law: Any, problem: TorqueProblem) -> Array:
    """Terms (3, terms, 7) at three ticks from a start [N m]."""
    memory, rows = law.start(problem), []
    for k in range(3):
        terms, memory = law.torque(replace(problem, t_s=problem.t_s + k * DT), memory)
        rows.append(np.array(terms))
    return np.array(rows)


def finite(config: Any) -> None:
    """A finite row for every term, with and without a trocar, the same each time."""
    for trocar in (True, False):
        for seed in range(3):
            problem = torque_problem(seed, trocar=trocar)
            law = config().build(arm())
            require(len(set(law.terms)) == len(law.terms) > 0, f"terms are none or named twice: {law.terms}")
            first, shape = _rows(law, problem), (3, len(law.terms), 7)
            require(
                first.shape == shape, f"the terms of three ticks have the shape {first.shape}, not {shape}"
            )
            require(np.isfinite(first).all(), "a term is not finite")
            require(np.abs(first.sum(axis=1)).max() > 1e-3, "the torque is nought")
            require(np.array_equal(_rows(law, problem), first), "the same problem gives other torques again")
            new = _rows(config().build(arm()), problem)
            require(np.array_equal(new, first), "a new object gives other torques")


def rest(config: Any) -> None:
    """With no error and at rest, what is left is gravity."""
    p, zero3, zero7 = torque_problem(4, trocar=False), np.zeros(3), np.zeros(7)
    dyn = arm().dynamics(p.q, zero7)
    p = replace(
        p,
        v=zero7,
        dyn=dyn,
        tau_measured=dyn.bias,
        command=replace(p.command, p_WTd=p.kin.p_WT, v_WTd=zero3, a_WTd=zero3),
        resolution=replace(p.resolution, qdot=zero7),
        q_ref=p.q,
    )
    law = config().build(arm())
    terms, _ = law.torque(p, law.start(p))
    apart = np.abs(np.asarray(terms).sum(axis=0) - dyn.bias).max()
    require(apart <= 1e-9, f"an arm at rest without error is given {apart:.3g} N m beside gravity")


CHECKS = (
    Check(name="a finite row for every term, the same each time", run=finite),
    Check(name="an arm that is where it should be is held against gravity alone", run=rest),
)
