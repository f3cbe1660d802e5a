"""How long a tick takes, in the time of its thread: differs between machines."""

from dataclasses import replace
from time import thread_time

import numpy as np

from surgsim.columns import scalar
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.passive_qp import PassiveQpConfig
from surgsim.models.arm import ArmModel
from surgsim.scenario.schema import Scenario
from surgsim.simulate.loop import simulate
from surgsim.studies.passive_teleoperation.cases import Shipped
from surgsim.studies.study import Row
from surgsim.tick.arrays import Array, Resolved, Seen

WARM_TICKS = 100
QP_LIMIT_US = 200.0


class TimedQpConfig(PassiveQpConfig):
    """`passive_qp` whose trace has the time of each step as `qp_time_s`."""

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver, its kernel called from Python."""
        inner = super().build(arm)
        last = sum(len(block.columns) for block in inner.columns)

        def kernel(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
            began = thread_time()
            status = inner.kernel(gains, seen, memory, out)
            out.values[last] = thread_time() - began
            return status

        return replace(inner, kernel=kernel, columns=(*inner.columns, scalar("qp_time", "s")))


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
