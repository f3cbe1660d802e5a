"""A recorded run as an episode of steps: what a policy saw, did and got, at the policy's rate."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.env.environment import DECIMATION
from surgsim.env.rewards import reward
from surgsim.errors import SurgsimError, unknown_name
from surgsim.export.subjects import BatchSubject, RunSubject, Subject
from surgsim.recording.scene import scenario_of
from surgsim.scenario.arms import each_arm
from surgsim.trace.trace import Trace

Action = Literal["tip_velocity", "joint_velocity", "torque"]
ACTIONS: tuple[Action, ...] = get_args(Action)

_STATE = ("q", "v", "tip", "tip_ref", "trocar")
_WHOLE = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class Episode:
    """The steps of a run; a step begins at a row of the trace and lasts until the next one.

    Attributes:
        run: The run.
        rows: Row at which each step begins (steps,), and that at which the last one ends: (steps + 1,).
        rate_hz: Steps a second.
        state: What was at the beginning of each step (steps + 1, width), the end included: true values.
        state_names: The columns of `state`, with units.
        action: What was commanded during each step (steps, width).
        action_names: The columns of `action`, with units.
        reward: Of the state that each step reaches (steps,), see `surgsim.env.rewards.reward`.
        success: Whether the task was done; None where that is not defined.
        task: What is to be done, in words.
        robot: The arm.
    """

    run: RunSubject
    rows: NDArray[np.intp]
    rate_hz: int
    state: Array
    state_names: tuple[str, ...]
    action: Array
    action_names: tuple[str, ...]
    reward: Array
    success: bool | None
    task: str
    robot: str

    def __len__(self) -> int:
        return len(self.action)


def episode_of(run: RunSubject, action: Action = "tip_velocity", rate_hz: float | None = None) -> Episode:
    """The steps of a run, without the stop that followed its outcome.

    The action of a step is the mean over its ticks: of the commanded tip's velocity, of the resolver's joint
    velocities, or of the commanded torques: what one action that holds, as in an environment, comes to.

    Args:
        run: The run.
        action: What is taken for the action.
        rate_hz: Steps a second; None: the rate at which its controller's policy was asked, else that of an
            environment.

    Raises:
        SurgsimError: If the run was not recorded or is shorter than a step, the rate does not divide that of
            the control loop or is no whole number, or there is no such action.
    """
    if action not in ACTIONS:
        raise SurgsimError(f"--action: {unknown_name(action, 'kind of action', ACTIONS)}")
    trace, scenario = run.trace.active(), scenario_of(run.trace)
    ticks, rate = _ticks_of_a_step(trace, rate_hz, _asked_every(run.trace.meta.scenario))
    count = (len(trace) - 1) // ticks
    if count < 1:
        raise SurgsimError(f"{run.path}: the run is shorter than a step of {1.0 / rate:g} s")
    rows = ticks * np.arange(count + 1)
    state, state_names = _state(trace, rows)
    actions, action_names = _actions(trace, rows, action)
    if not (np.isfinite(state).all() and np.isfinite(actions).all()):
        raise SurgsimError(f"{run.path}: its states or its {action} are not defined at every tick")
    return Episode(
        run=run,
        rows=rows,
        rate_hz=rate,
        state=state,
        state_names=state_names,
        action=actions,
        action_names=action_names,
        reward=_rewards(trace, rows[1:]),
        success=run.summary.get("success"),
        task=scenario.description or scenario.name,
        robot=each_arm(scenario)[0].robot.label,
    )


def _asked_every(scenario: Mapping[str, Any]) -> int:
    """Ticks for which an action of the controller's policy holds; of an environment's without a policy."""
    for part in ("torque_law", "resolver"):
        found = scenario["controller"].get(part) or {}
        if found.get("type") == "policy":
            return int(found["decimation"])
    return DECIMATION


def _ticks_of_a_step(trace: Trace, rate_hz: float | None, default: int) -> tuple[int, int]:
    """Ticks of a step, and steps a second."""
    tick_hz = 1.0 / trace.meta.control_period_s
    if rate_hz is not None and not 0.0 < rate_hz < math.inf:
        raise SurgsimError(f"--rate: {rate_hz:g} is not allowed: a rate above 0 Hz")
    ticks = default if rate_hz is None else tick_hz / rate_hz
    rate = tick_hz / ticks
    if (
        ticks < 1.0 - _WHOLE
        or abs(ticks - round(ticks)) > _WHOLE * ticks
        or abs(rate - round(rate)) > _WHOLE * rate
    ):
        raise SurgsimError(
            f"--rate: {rate:g} Hz is not allowed: a whole number that divides the control's {tick_hz:g} Hz"
        )
    return round(ticks), round(rate)


def _state(trace: Trace, rows: NDArray[np.intp]) -> tuple[Array, tuple[str, ...]]:
    """Joints, tip, its command, and the trocar if there is one."""
    blocks = [name for name in _STATE if np.isfinite(trace.block(name)[rows]).any()]
    names = tuple(column for name in blocks for column in trace.columns_of(name))
    return np.hstack([trace.block(name)[rows] for name in blocks]), names


def _actions(trace: Trace, rows: NDArray[np.intp], action: Action) -> tuple[Array, tuple[str, ...]]:
    if action == "tip_velocity":
        moved = np.diff(trace.block("tip_ref")[rows], axis=0)
        return moved / np.diff(trace["t_s"][rows])[:, np.newaxis], tuple(
            f"v_tip_{axis}_m_per_s" for axis in "xyz"
        )
    block = "qdot_ref" if action == "joint_velocity" else "tau"
    sums = np.add.reduceat(trace.block(block)[: rows[-1]], rows[:-1], axis=0)
    return sums / np.diff(rows)[:, np.newaxis], trace.columns_of(block)


def _rewards(trace: Trace, rows: NDArray[np.intp]) -> Array:
    tip, rcm = trace["tip_error_m"][rows], trace["rcm_error_m"][rows]
    defined = bool(np.isfinite(rcm).any())
    return np.array([reward(float(t), float(r) if defined else None) for t, r in zip(tip, rcm, strict=True)])


def runs_of(subjects: Sequence[Subject]) -> list[RunSubject]:
    """The runs given, and every run of the batches given.

    Raises:
        SurgsimError: If something else is given, or a run has several arms.
    """
    found: list[RunSubject] = []
    for subject in subjects:
        if isinstance(subject, BatchSubject):
            found += [subject.run(str(row["run_id"])) for row in subject.results.rows]
        elif isinstance(subject, RunSubject):
            found.append(subject)
        else:
            raise SurgsimError("episodes are of runs and batches, not of a study")
    for run in found:
        if run.arm or run.arms:
            raise SurgsimError(
                f"{run.path}: a run of several arms; episodes are of runs of one; "
                "--data FILE takes all columns"
            )
    return found


def check_alike(episodes: Sequence[Episode]) -> None:
    """Refuse runs that have not the same columns, arm and rate.

    Raises:
        SurgsimError: If two differ, with what they differ in.
    """
    first = episodes[0]
    for other in episodes[1:]:
        for what, one, two in (
            ("arm", first.robot, other.robot),
            ("rate", first.rate_hz, other.rate_hz),
            ("columns", first.state_names, other.state_names),
        ):
            if one != two:
                raise SurgsimError(
                    f"{first.run.path} and {other.run.path} differ in their {what}: a data set has one"
                )


def origin_of(episode: Episode) -> dict[str, Any]:
    """Where an episode comes from, as data for JSON."""
    scenario, controller, seed = episode.run.named
    told = {"scenario": scenario, "controller": controller, "seed": seed}
    return {**told, "outcome": episode.run.outcome, "success": episode.success}
