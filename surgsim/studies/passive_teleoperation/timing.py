"""How long a tick takes: differs between machines, and from run to run on a busy one."""

from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from surgsim.columns import Block, scalar
from surgsim.control.problem import Resolution, VelocityProblem
from surgsim.control.resolvers.passive_qp import PassiveQp, PassiveQpConfig, PassiveQpMemory
from surgsim.models.arm import ArmModel
from surgsim.scenario.schema import Scenario
from surgsim.simulate.loop import simulate
from surgsim.studies.passive_teleoperation.cases import Shipped
from surgsim.studies.study import Row

WARM_TICKS = 100
QP_LIMIT_US = 200.0


class TimedQpConfig(PassiveQpConfig):
    """`passive_qp` whose trace has the time of each step as `qp_time_s`."""

    def build(self, arm: ArmModel) -> Any:
        """The resolver."""
        return _TimedQp(super().build(arm))


class _TimedQp:
    """A resolver with the time of its step as a further column."""

    def __init__(self, inner: PassiveQp) -> None:
        self._inner = inner
        self.columns: tuple[Block, ...] = (*inner.columns, scalar("qp_time", "s"))

    def start(self, problem: VelocityProblem) -> PassiveQpMemory:
        """As the resolver."""
        return self._inner.start(problem)

    def step(self, problem: VelocityProblem, memory: PassiveQpMemory) -> tuple[Resolution, PassiveQpMemory]:
        """As the resolver, timed."""
        began = perf_counter()
        resolution, memory = self._inner.step(problem, memory)
        took = perf_counter() - began
        return replace(resolution, values=np.append(resolution.values, took)), memory


def timed(scenario: Scenario) -> Scenario:
    """The scenario with its QP timed."""
    controller = scenario.controller
    resolver = TimedQpConfig(**controller.resolver.model_dump())
    return scenario.model_copy(update={"controller": controller.model_copy(update={"resolver": resolver})})


def timing_row(case: Shipped) -> Row:
    """Median and 99th percentile of a tick's time in this process alone [us], after `WARM_TICKS`."""
    trace = simulate(timed(case.scenario()))
    qp, control = (1e6 * trace[name][WARM_TICKS:] for name in ("qp_time_s", "control_time_s"))
    return {
        "scenario": case.name,
        "ticks": len(qp),
        "qp_p50_us": float(np.percentile(qp, 50.0)),
        "qp_p99_us": float(np.percentile(qp, 99.0)),
        "controller_p50_us": float(np.percentile(control, 50.0)),
        "controller_p99_us": float(np.percentile(control, 99.0)),
    }
