"""Teleoperation: how well the tip follows the master, and where the energy went.

Undefined (NaN) for a trace of another task. Velocities of the tip are central differences of its true
position.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.metrics.accuracy import rms
from surgsim.metrics.force import largest
from surgsim.metrics.metric import CHOICE, FORCE_RESOLUTION, REPEATABILITY, Metric, with_block
from surgsim.teleop.judgement import (
    drift,
    end_speed,
    excess_j,
    force_fidelity,
    toggles_per_s,
    transmitted_impedance,
)
from surgsim.trace.trace import Trace

Mask = NDArray[np.bool_]
FREE_SLACK_M_PER_S = 1e-4
FREE_FORCE_N = 0.1
_CONSTRAINTS = ("passivity_active", "planes_active", "qp_relaxed")
_ALONE = ("ring_state", "trocar_force")
_PRESSING = {"tissue", "contact_wall"}
_PUSHING = {"push", "guiding_hand"}


def _teleoperated(compute: Callable[[Trace], float]) -> Callable[[Trace], float]:
    """`compute`, for traces of a teleoperation."""
    return with_block("velocity_command", compute, rows=2)


def _of(block: str, compute: Callable[[Trace], float]) -> Callable[[Trace], float]:
    """`compute`, for teleoperations whose trace has `block`."""
    return _teleoperated(with_block(block, compute))


def free_ticks(trace: Trace) -> Mask:
    """Ticks in which nothing keeps the tip from its commanded velocity.

    No constraint of the controller is active, its slack is below 0.1 mm/s, and nothing presses on the tip
    with more than 0.1 N.
    """
    free = np.ones(len(trace), dtype=bool)
    for name in _CONSTRAINTS:
        if name in trace:
            free &= trace[name] == 0.0
    if "slack" in trace:
        free &= np.linalg.norm(trace.block("slack"), axis=1) <= FREE_SLACK_M_PER_S
    if "tip_force" in trace:
        free &= np.linalg.norm(trace.block("tip_force"), axis=1) <= FREE_FORCE_N
    return free


def tip_velocity(trace: Trace) -> Array:
    """Velocity of the tip (rows, 3) [m/s]."""
    velocity: Array = np.gradient(trace.block("tip"), trace["t_s"], axis=0)
    return velocity


def velocity_error(trace: Trace, command: str) -> float:
    """RMS distance of the tip's velocity from `command` over the free ticks [m/s]; NaN without any."""
    free = free_ticks(trace)
    error = np.linalg.norm(tip_velocity(trace) - trace.block(command), axis=1)[free]
    return rms(error) if error.size else math.nan


def energy_residual(trace: Trace) -> Array:
    """What the energy ledger of the whole system does not explain, at every tick (rows,) [J].

    Sum of the absolute residuals of its parts, so that none can hide another:

        tanks and channels   change of T_o + T_r, + in flight + lost + overflow - deficit + W_handle + W_tip
        console              kinetic + potential - motors - hand + damping + friction
        arm                  kinetic + potential + springs - actuators - applied - contact + losses
        tip                  W_tip as booked by the tank + the touch's work on the arm as the plant has it

    The last one where nothing but the tip is touched. Rows of a trace without a ledger are NaN.
    """
    if "energy_residual" not in trace:
        return np.full(len(trace), np.nan)
    total = np.abs(trace["console_residual_j"]) + np.abs(trace["energy_residual_j"])
    if np.isfinite(trace["tank_account_residual_j"]).all():
        total += np.abs(trace["tank_account_residual_j"])
    touch = _work_of_touch(trace)
    if touch is not None:  # late: of the instant at which the last physics step began
        late = trace.meta.scenario["simulation"]["timestep_s"] / trace.meta.control_period_s
        total[:-1] += np.abs(trace["environment_work_j"][:-1] + touch[:-1] + late * np.diff(touch))
    return total


def _work_of_touch(trace: Trace) -> Array | None:
    """Work of what the tip touches on the arm, by the plant's ledger (rows,) [J]; None if more is in it."""
    scenario = trace.meta.scenario
    acting = {part["type"] for key in ("disturbances", "props") for part in scenario.get(key, ())}
    pressing = acting & _PRESSING
    if any(name in trace for name in _ALONE) or (pressing and acting & _PUSHING):
        return None
    touch = trace["energy_contact_work_j"]
    return touch + trace["energy_applied_work_j"] if pressing else touch


def energy_exchanged(trace: Trace) -> float:
    """Energy that went to and fro between the system, the operator and what the tip touches [J]."""
    works = (trace["hand_work_j"], trace["environment_work_j"])
    return float(sum(np.abs(np.diff(work)).sum() for work in works))


def _residual_fraction(trace: Trace) -> float:
    exchanged = energy_exchanged(trace)
    return float(np.max(energy_residual(trace))) / exchanged if exchanged > 0.0 else math.nan


def _tank_min(trace: Trace) -> float:
    if not np.isfinite(trace["tank_account_residual_j"]).all():
        return math.nan
    return float(min(trace["tank_operator_j"].min(), trace["tank_remote_j"].min()))


def tank_deficit(trace: Trace) -> float:
    """What was taken from empty tanks, both together [J]; NaN without tanks."""
    if not np.isfinite(trace["tank_account_residual_j"]).all():
        return math.nan
    return float(trace["tank_operator_deficit_j"][-1] + trace["tank_remote_deficit_j"][-1])


def acceleration_ratio(trace: Trace) -> float:
    """Largest change of a joint's commanded velocity from tick to tick, over its acceleration limit."""
    steps = np.abs(np.diff(trace.block("qdot_ref"), axis=0)) / trace.meta.control_period_s
    ratio: Array = steps / np.array(trace.meta.limits["acceleration"])
    return float(np.nanmax(ratio)) if np.isfinite(ratio).any() else math.nan


def _delay_back(trace: Trace) -> float:
    """Delay of the channel back [s]."""
    task = trace.meta.scenario["task"]
    return float((task.get("channel_back") or task["channel"])["delay_s"])


def _impedance(trace: Trace) -> tuple[float, float]:
    return transmitted_impedance(trace, _delay_back(trace))


def plane_overshoot(trace: Trace) -> float:
    """How far the tip got past a virtual wall of the resolver [m], 0 if never; NaN without walls."""
    resolver = trace.meta.scenario["controller"]["resolver"]
    past = [0.0]
    for plane in resolver.get("planes", ()):
        normal = np.array(plane["normal"], dtype=float)
        normal /= np.linalg.norm(normal)
        past.append(float(np.max(trace.block("tip") @ normal)) - plane["offset_m"])
    return max(past) if len(past) > 1 else math.nan


def task_time(trace: Trace) -> float:
    """When the operator had done with all goals [s]; NaN if never."""
    done = np.flatnonzero(trace["operator_done"] > 0.0)
    return float(trace["t_s"][done[0]]) if done.size else math.nan


def _answered(values: Array) -> Array:
    """`values` (rows,) of the ticks in which the controller had an answer."""
    return values[np.isfinite(values)]


METRICS = (
    Metric(
        name="velocity_error_rms_mm_per_s",
        heading="velocity error, RMS [mm/s]",
        matters=0.1,
        matters_source=CHOICE,
        meaning="RMS of tip velocity less the command that acts now, while no constraint is active",
        compute=_teleoperated(lambda trace: 1e3 * velocity_error(trace, "velocity_command")),
    ),
    Metric(
        name="velocity_error_unaligned_rms_mm_per_s",
        heading="velocity error with the delay, RMS [mm/s]",
        matters=0.1,
        matters_source=CHOICE,
        meaning="the same against what the master does now: the channel's delay included",
        compute=_teleoperated(lambda trace: 1e3 * velocity_error(trace, "velocity_issued")),
    ),
    Metric(
        name="tank_min_j",
        heading="energy in the tanks, lowest [J]",
        matters=1e-3,
        matters_source=CHOICE,
        meaning="lowest level of the two energy tanks",
        compute=_teleoperated(_tank_min),
        lower_is_better=False,
    ),
    Metric(
        name="tank_deficit_j",
        heading="energy taken from empty tanks [J]",
        matters=1e-3,
        matters_source=CHOICE,
        meaning="energy that was taken from the tanks though they were empty",
        compute=_teleoperated(tank_deficit),
    ),
    Metric(
        name="acceleration_limit_ratio",
        heading="change of the commanded joint velocity, over the limit",
        matters=0.01,
        matters_source=CHOICE,
        meaning="largest change of a joint's commanded velocity in a tick, over its acceleration limit",
        compute=_of("qdot_ref", acceleration_ratio),
    ),
    Metric(
        name="delivered_max_j",
        heading="energy delivered, largest [J]",
        matters=1e-3,
        matters_source=CHOICE,
        meaning="largest net energy that hand and surroundings got; what the tanks held is theirs to give",
        compute=_teleoperated(lambda trace: float(np.max(trace["delivered_j"]))),
    ),
    Metric(
        name="delivered_excess_j",
        heading="energy delivered beyond the stored [J]",
        matters=1e-3,
        matters_source=CHOICE,
        meaning="energy delivered, less what the tanks held at first; above 0 is active",
        compute=_teleoperated(excess_j),
    ),
    Metric(
        name="contact_toggles_max_per_s",
        heading="contact begun or ended, most in a second [1/s]",
        matters=2.0,
        matters_source=CHOICE,
        meaning="most beginnings and ends of contact at the tip within a second",
        compute=_of("tip_force", toggles_per_s),
    ),
    Metric(
        name="end_speed_mm_per_s",
        heading="speed at the end, largest [mm/s]",
        matters=1.0,
        matters_source=CHOICE,
        meaning="largest speed of handle or tip in the last half second",
        compute=_teleoperated(lambda trace: 1e3 * end_speed(trace)),
    ),
    Metric(
        name="drift_end_mm",
        heading="tip from where the master points, at the end [mm]",
        matters=0.1,
        matters_source=REPEATABILITY,
        meaning="distance of the tip from where the master points, at the end",
        compute=_teleoperated(lambda trace: 1e3 * drift(trace)),
    ),
    Metric(
        name="force_fidelity",
        heading="correlation of the force on hand and tip",
        matters=0.01,
        matters_source=CHOICE,
        meaning="correlation of the rendered force with the tip's, the channel's delay before",
        compute=_of("tip_force", lambda trace: force_fidelity(trace, _delay_back(trace))),
        lower_is_better=False,
    ),
    Metric(
        name="transmitted_stiffness_n_per_m",
        heading="stiffness felt in contact [N/m]",
        matters=1.0,
        matters_source=CHOICE,
        meaning="stiffness that the hand feels while it knows of a contact",
        compute=_of("tip_force", lambda trace: _impedance(trace)[0]),
        lower_is_better=None,
    ),
    Metric(
        name="transmitted_damping_ns_per_m",
        heading="damping felt in contact [N s/m]",
        matters=0.1,
        matters_source=CHOICE,
        meaning="damping that the hand feels while it knows of a contact",
        compute=_of("tip_force", lambda trace: _impedance(trace)[1]),
        lower_is_better=None,
    ),
    Metric(
        name="energy_residual_j",
        heading="energy not explained, largest [J]",
        matters=1e-3,
        matters_source=CHOICE,
        meaning="largest energy that the ledger of the whole system does not explain",
        compute=_teleoperated(lambda trace: float(np.max(energy_residual(trace)))),
    ),
    Metric(
        name="energy_residual_fraction",
        heading="energy not explained, share",
        matters=0.01,
        matters_source=CHOICE,
        meaning="the same over the energy exchanged with operator and surroundings",
        compute=_teleoperated(_residual_fraction),
    ),
    Metric(
        name="master_force_max_n",
        heading="force on the hand, largest [N]",
        matters=0.05,
        matters_source=FORCE_RESOLUTION,
        meaning="largest force rendered at the master's handle",
        compute=_of("master_force", lambda trace: largest(trace, "master_force")),
        lower_is_better=None,
    ),
    Metric(
        name="plane_overshoot_max_mm",
        heading="distance past a virtual wall, largest [mm]",
        matters=0.1,
        matters_source=REPEATABILITY,
        meaning="how far the tip got past a virtual wall",
        compute=_teleoperated(lambda trace: 1e3 * plane_overshoot(trace)),
    ),
    Metric(
        name="slack_rms_mm_per_s",
        heading="tip velocity given up, RMS [mm/s]",
        matters=0.1,
        matters_source=CHOICE,
        meaning="RMS of the tip velocity that the controller gave up",
        compute=_of(
            "slack", lambda trace: 1e3 * rms(_answered(np.linalg.norm(trace.block("slack"), axis=1)))
        ),
        lower_is_better=None,
    ),
    Metric(
        name="passivity_active_fraction",
        heading="ticks limited by the energy budget, share",
        matters=0.01,
        matters_source=CHOICE,
        meaning="fraction of ticks in which the energy budget limits the tip",
        compute=_of("passivity_active", lambda trace: float(np.mean(_answered(trace["passivity_active"])))),
        lower_is_better=None,
    ),
    Metric(
        name="relaxed_ticks",
        heading="ticks with relaxed bounds",
        meaning="ticks in which the acceleration bounds gave way to hard rows",
        compute=_of("qp_relaxed", lambda trace: float(np.sum(_answered(trace["qp_relaxed"])))),
    ),
    Metric(
        name="goals_missed",
        heading="goals missed",
        meaning="goals that the operator gave up",
        compute=_teleoperated(lambda trace: float(trace["goals_missed"][-1])),
    ),
    Metric(
        name="task_time_s",
        heading="time for the task [s]",
        matters=0.1,
        matters_source=CHOICE,
        meaning="time after which the operator had done with all goals",
        compute=_teleoperated(task_time),
    ),
)
