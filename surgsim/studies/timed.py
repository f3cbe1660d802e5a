"""A case whose quadratic program is timed."""

from dataclasses import dataclass, replace
from time import thread_time
from typing import ClassVar

import numpy as np

from surgsim.array import Array
from surgsim.columns import scalar, width
from surgsim.control.resolvers.base import KernelResolver
from surgsim.control.resolvers.passive_qp import PassiveQpConfig
from surgsim.models.arm import ArmModel
from surgsim.scenario.schema import Scenario
from surgsim.studies.study import SimulatedCase
from surgsim.studies.tables import Cell, Row
from surgsim.tick.arrays import Resolved, Seen
from surgsim.trace.trace import Trace


class TimedQpConfig(PassiveQpConfig):
    """`passive_qp` whose trace has the time of each step as `qp_time_s`."""

    def build(self, arm: ArmModel) -> KernelResolver:
        """The resolver, its kernel called from Python."""
        inner = super().build(arm)
        last = width(inner.columns)

        def kernel(gains: Array, seen: Seen, memory: Array, out: Resolved) -> int:
            began = thread_time()
            status = inner.kernel(gains, seen, memory, out)
            out.values[last] = thread_time() - began
            return status

        return replace(inner, kernel=kernel, columns=(*inner.columns, scalar("qp_time", "s")))


@dataclass(frozen=True)
class Timed(SimulatedCase):
    """How long a tick of a case with `passive_qp` takes, in its thread's time: differs between machines.

    Attributes:
        of: The case.
        warm_ticks: Ticks that do not count.
    """

    alone: ClassVar[bool] = True
    of: SimulatedCase
    warm_ticks: int = 100

    @property
    def label(self) -> str:
        """In words."""
        return f"timing, {self.of.label}"

    def scenario(self) -> Scenario:
        """The scenario with its QP timed."""
        scenario = self.of.scenario()
        controller = scenario.controller
        assert isinstance(controller.resolver, PassiveQpConfig)
        resolver = TimedQpConfig(**controller.resolver.model_dump())
        return scenario.model_copy(
            update={"controller": controller.model_copy(update={"resolver": resolver})}
        )

    def measures(self, trace: Trace) -> Row:
        """Median and 99th percentile of a tick's time [us]."""
        found: dict[str, Cell] = {"scenario": self.of.label, "ticks": len(trace) - self.warm_ticks}
        for name, column in (("qp", "qp_time_s"), ("controller", "control_time_s")):
            time_us = 1e6 * trace[column][self.warm_ticks :]
            found |= {f"{name}_p{at}_us": float(np.percentile(time_us, at)) for at in (50, 99)}
        return found
