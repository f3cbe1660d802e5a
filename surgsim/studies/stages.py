"""Two stages of a procedure, one after the other: an arm is led in by hand, then it works on its own."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from surgsim.display import count
from surgsim.scenario.schema import Scenario
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare
from surgsim.studies.figure import Axes, label
from surgsim.studies.measures import tracking
from surgsim.studies.study import Case, Judged, Measured, Results, holds
from surgsim.studies.tables import Row, Tables, numbers, span
from surgsim.trace.trace import Trace

STAGES = ("led", "tracked")
_EVERY = 10
"""Rows between points that are drawn."""


class LedThenTracking(Case):
    """A scenario that a hand leads, then a second one from the posture in which the first one ended.

    The arm is switched from one to the other at rest: what is left of the joints' velocities is reported, and
    not carried over.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """What the table calls it."""

    @abstractmethod
    def stages(self) -> tuple[Scenario, Scenario]:
        """Both scenarios; the second one's path begins where the first one leaves the tip."""

    def measured(self) -> Measured:
        """Errors of both stages, what the switch meets, and errors over time and depth of the tip."""
        first, second = self.stages()
        led = simulate(first)
        setup = prepare(second)
        traces = (led, Simulation(replace(setup, q_start=led.block("q")[-1])).run())
        row: Row = {
            "controller": self.name,
            **{f"{stage}_{k}": v for stage, t in zip(STAGES, traces, strict=True) for k, v in _row(t)},
            "switch_velocity_rad_per_s": float(np.abs(led.block("v")[-1]).max()),
            "switch_tip_mm": 1e3 * float(traces[1]["tip_error_m"][0]),
            "switch_rcm_mm": 1e3 * float(traces[1]["rcm_error_m"][0]),
        }
        port = np.array(led.meta.scenario["trocar"]["position_m"])
        curves = {
            f"{stage}_{name}": values[::_EVERY]
            for stage, trace in zip(STAGES, traces, strict=True)
            for name, values in (
                *((column, trace[column]) for column in ("t_s", "tip_error_m", "rcm_error_m")),
                ("depth_m", port[2] - trace.block("tip")[:, 2]),
            )
        }
        return Measured(case=self, row=row, curves=curves)


def _row(trace: Trace) -> list[tuple[str, str | int | float | None]]:
    return [(name, value) for name, value in tracking(trace).items() if name != "mu_mean"]


def draw_stages(styles: Mapping[str, Mapping[str, Any]], axes: Axes, results: Results, _: Tables) -> None:
    """Depth of the tip below the port, tip and RCM error over both stages, a line a controller."""
    for found in results["hands_on"]:
        curves, style = found.curves, styles[found.case.method]
        led, tracked = (curves[f"{stage}_t_s"] for stage in STAGES)
        t = np.concatenate((led, led[-1] + tracked))
        for ax, name in zip(axes.flat, ("depth_m", "tip_error_m", "rcm_error_m"), strict=True):
            ax.plot(t, 1e3 * np.concatenate([curves[f"{stage}_{name}"] for stage in STAGES]), **style)
            ax.axvline(led[-1], color="0.7", linewidth=0.8, linestyle=":")
    for ax in axes.flat[1:]:
        ax.set(yscale="log", ylim=(1e-5, 30.0))
    words = ("depth of the tip below the port (mm)", "tip error (mm)", "RCM error (mm)")
    label(axes, "time (s); dotted: the tracking begins", titles=words, legend=len(styles))


def judge_stages(tip_mm: float, rcm_mm: float, tables: Tables) -> Judged:
    """Whether every controller of the table `hands_on` completes both stages within these errors [mm]."""
    rows, parts, good = tables["hands_on"], [], []
    for stage in STAGES:
        tip, rcm = (numbers(rows, f"{stage}_{name}_max_mm") for name in ("tip", "rcm"))
        good += [max(tip) <= tip_mm, max(rcm) <= rcm_mm]
        good += [row[f"{stage}_outcome"] == "completed" for row in rows]
        parts.append(f"{stage}: tip {span(tip)}, RCM {span(rcm)} mm")
    return holds(all(good)), f"{count(len(rows), 'controller')}, largest errors {'; '.join(parts)}"
