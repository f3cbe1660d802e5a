"""The control loop: controller and plant, tick by tick, into a trace."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from surgsim.columns import joints
from surgsim.compiled import compiled
from surgsim.compiled.watch import thread_time_ns
from surgsim.control.controller import ControlOutput
from surgsim.control.problem import ControlFailure
from surgsim.errors import Outcome
from surgsim.plant.state import State
from surgsim.scenario.schema import Scenario, StopConfig
from surgsim.simulate.rows import Rows
from surgsim.simulate.safety import SafetyMonitor
from surgsim.simulate.setup import Setup, prepare
from surgsim.simulate.stop import StopLaw
from surgsim.tasks.base import Feedback, TipCommand
from surgsim.trace.trace import BASE_BLOCKS, Ending, Trace, TraceMeta

Array = NDArray[np.float64]
Progress = Callable[[float, float], None]
"""Called now and then with the simulated time reached and the whole duration [s]."""

_PROGRESS_TICKS = 250
_NO_STOP = StopConfig(duration_s=0.0)


def simulate(scenario: Scenario, progress: Progress | None = None) -> Trace:
    """Run a scenario to its end, or to the outcome that stops it.

    Raises:
        SurgsimError: If it cannot be started, e.g. because the path is out of reach.
    """
    return Simulation(prepare(scenario)).run(progress)


class Simulation:
    """One run of a prepared scenario, stepped by `tick`, or by `run` to its end and the stop after it.

    Every row of the trace holds the state at a tick, the command for it, and the torque commanded from it.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        scenario = setup.scenario
        self._period = scenario.simulation.control_period_s
        self._ticks = math.ceil(setup.task.duration_s / self._period - 1e-6)
        self._torque_limit = setup.scene.limits.torque
        wall = setup.scene.wall
        tear = math.inf if wall is None else wall.tear_force_n
        self._safety = SafetyMonitor(scenario.safety, setup.scene.limits, scenario.trocar is not None, tear)
        self._stop = StopLaw(scenario.safety.stop or StopConfig(), setup.arm)
        self._stop_ticks = round((scenario.safety.stop or _NO_STOP).duration_s / self._period)
        self._infeasible = 0
        groups = {
            "terms": tuple(joints(f"tau_{term}_", "nm") for term in setup.controller.terms),
            "task": setup.task.columns,
            "controller": setup.controller.columns,
            "plant": setup.plant.columns,
        }
        self._rows = Rows(BASE_BLOCKS, groups, self._ticks + 1 + self._stop_ticks)
        self._uses_torque = scenario.plant.uses_torque
        self._state: State = setup.plant.reset(setup.q_start)
        setup.controller.reset()
        setup.task.reset()
        self._count = 0
        self._ending: Ending | None = None
        self._command = self._ask()

    @property
    def time_s(self) -> float:
        """Simulated time reached [s]."""
        return self._count * self._period

    @property
    def ended(self) -> bool:
        """Whether the run has ended."""
        return self._ending is not None

    @property
    def ending(self) -> Ending | None:
        """How the run ended; None while it goes on."""
        return self._ending

    @property
    def state(self) -> State:
        """The plant's state at the present tick."""
        return self._state

    @property
    def command(self) -> TipCommand:
        """The task's command at the present tick."""
        return self._command

    @property
    def due(self) -> bool:
        """Whether the next tick ends the run whatever the controller does: time is up, or a limit passed."""
        return self._is_last or self._check() is not None

    def run(self, progress: Progress | None = None) -> Trace:
        """Tick to the end; if that is an outcome that stops the arm, stop it and hold it for a while."""
        duration = self._setup.task.duration_s
        while not self.ended:
            self.tick()
            if progress is not None and self._count % _PROGRESS_TICKS == 0:
                progress(self.time_s, duration)
        self._hold()
        return self.trace()

    def tick(self) -> None:
        """One control period: look, decide, record, act. Does nothing once ended."""
        if self.ended:
            return
        setup, state, command = self._setup, self._state, self._command
        row = self._rows.add(state.t_s, setup.plant.truth(), command)
        row[self._rows.group["task"]] = setup.task.values()
        self._ending = self._check()
        if self.ended:
            return
        if command.rcm_shift is not None and command.rcm_shift_rate is not None:
            centre, rate = state.p_WC + command.rcm_shift, state.v_WC + command.rcm_shift_rate
            state = replace(state, p_WC=centre, v_WC=rate)
        began = thread_time_ns()
        try:
            output = setup.controller.tick(state, command)
        except ControlFailure as failure:
            self._fail(row, failure)
            return
        self._infeasible = 0
        self._stop.release()
        self._record(row, output, 1e-9 * (thread_time_ns() - began))
        if not math.isfinite(output.torque @ output.torque):
            self._ending = Ending(outcome=Outcome.DIVERGED, t_s=state.t_s, detail="torque is not finite")
            return
        if self._is_last:
            self._ending = Ending(outcome=Outcome.COMPLETED, t_s=state.t_s)
            return
        self._act(output.torque, output.resolution.qdot)
        self._command = self._ask()

    def _act(self, torque: Array, qdot: Array) -> None:
        self._state = self._setup.plant.step(torque, qdot, self._command.jaw)
        self._count += 1

    def _fail(self, row: Array, failure: ControlFailure) -> None:
        """The controller has no answer: brake for this tick, or end the run."""
        infeasible = failure.outcome is Outcome.INFEASIBLE
        self._infeasible += infeasible
        row[self._rows.at["infeasible"]] = float(infeasible)
        most = self._setup.scenario.safety.infeasible_ticks_max
        if not infeasible or self._infeasible > most or self._is_last:
            self._ending = Ending(
                outcome=failure.outcome, t_s=self._state.t_s, detail=failure.detail, data=failure.data
            )
            return
        self._brake(row)
        self._command = self._ask()

    def _brake(self, row: Array) -> None:
        """One period of the stop's motion, in the controller's place."""
        self._setup.controller.reset()  # what it remembers is not what the arm did
        motion = self._stop.tick(self._state)
        row[self._rows.at["qdot_ref"]] = motion.qdot
        row[self._rows.at["q_ref"]] = motion.q
        if self._uses_torque:
            self._record_torque(row, motion.torque)
        self._act(motion.torque, motion.qdot)

    def _hold(self) -> None:
        """The stop after the outcome: rows without a command, for its time or until the state diverges."""
        if self._ending is None or self._ending.outcome is Outcome.COMPLETED or not self._uses_torque:
            return
        row: Array | None = None
        for _ in range(self._stop_ticks):
            if not math.isfinite(self._state.q @ self._state.q + self._state.v @ self._state.v):
                return
            motion = self._stop.tick(self._state)
            if row is not None:
                self._record_torque(row, motion.torque)
            self._act(motion.torque, motion.qdot)
            row = self._rows.add(self._state.t_s, self._setup.plant.truth(), None)
            row[self._rows.at["stopped"]] = 1.0
            row[self._rows.at["q_ref"]] = motion.q

    @property
    def _is_last(self) -> bool:
        return self._count >= self._ticks or self._setup.task.finished(self._state.t_s)

    def _check(self) -> Ending | None:
        return self._safety.check(self._state.t_s, self._setup.plant.truth(), self._command)

    def _ask(self) -> TipCommand:
        """The task's command for the present state, once a tick."""
        setup, state = self._setup, self._state
        if not setup.task.reacts:
            return setup.task.command(state.t_s)
        kin = setup.arm.kinematics(state.q)
        feedback = Feedback(
            p_WT=kin.p_WT,
            v_WT=kin.Jv_WT @ state.v,
            R_WT=kin.R_WT,
            w_WT=kin.Jw_WT @ state.v,
            f_T=state.f_T,
        )
        return setup.task.command(state.t_s, feedback)

    def trace(self) -> Trace:
        """The trace so far, with its derived columns."""
        ending = self._ending or Ending(outcome=Outcome.COMPLETED, t_s=self.time_s)
        limits = self._setup.scene.limits
        meta = TraceMeta(
            scenario=self._setup.scenario.resolved(),
            control_period_s=self._period,
            limits={
                name: getattr(limits, name).tolist()
                for name in ("q_min", "q_max", "velocity", "acceleration", "torque")
            },
            ending=ending,
        )
        return self._rows.finish(meta, self._setup.arm)

    def _record(self, row: Array, output: ControlOutput, took: float) -> None:
        at, group = self._rows.at, self._rows.group
        row[at["qdot_ref"]] = output.resolution.qdot
        row[at["q_ref"]] = output.q_ref
        row[at["resolver_residual"]] = output.resolution.residual
        row[at["control_time"]] = took
        row[group["controller"]] = output.values
        if self._uses_torque:
            self._record_torque(row, output.torque)
            row[group["terms"]] = output.terms.ravel()

    def _record_torque(self, row: Array, torque: Array) -> None:
        inside, count = _saturate(torque, self._torque_limit)
        row[self._rows.at["tau"]] = inside
        row[self._rows.at["saturated_joints"]] = count


@compiled
def _saturate(torque: Array, limit: Array) -> tuple[Array, int]:
    """`torque` cut at `limit`, and how many joints were cut."""
    inside, count = np.empty(7), 0
    for i in range(7):
        inside[i] = min(max(torque[i], -limit[i]), limit[i])
        count += inside[i] != torque[i]
    return inside, count
