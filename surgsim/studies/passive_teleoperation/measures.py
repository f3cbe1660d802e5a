"""What is measured of a trace: accuracy, energy, constraints, and how a push that is only held ends."""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.metrics.accuracy import rms
from surgsim.metrics.catalog import compute_metrics
from surgsim.metrics.teleoperation import tip_velocity
from surgsim.studies.measures import outcome
from surgsim.studies.study import Curves
from surgsim.studies.tables import Row, groups, number, pick
from surgsim.trace.trace import Trace

Steadiness = Literal["rests", "decays", "chatters", "oscillates", "grows", "runs away", "stopped"]

REST_MM_PER_S = 5.0
"""RMS speed of a handle at rest; tremor alone moves it by about 1 mm/s."""
STEADY_N, STEADY_SHARE = 0.5, 0.05
"""Standard deviation of a steady contact force: at most this, or this share of its mean."""
GROWTH, DECAY = 1.05, 0.8
"""Ratio of the handle's RMS speeds in the last two windows above which it grows, below which it decays."""
FAST_MM_PER_S = 150.0
"""RMS speed as high as the operator ever means to move, while it means to rest."""

UNSTABLE: tuple[Steadiness, ...] = ("oscillates", "grows", "runs away", "stopped")


def steadiness(
    outcome: str, speed_before: float, speed_end: float, force_mean: float, force_deviation: float
) -> Steadiness:
    """How a push ends, from its last two windows.

        stopped      the run did not complete: a safety limit was passed
        rests        handle below 5 mm/s RMS, contact force steady
        chatters     handle at rest, contact force not
        runs away    the handle moves at 150 mm/s RMS or more
        decays       the handle still moves, with at most 0.8 times the speed of the window before
        grows        at least 1.05 times that speed
        oscillates   neither: it neither dies away nor grows

    Args:
        outcome: How the run ended.
        speed_before: RMS speed of the handle in the window before the last [mm/s].
        speed_end: The same in the last window [mm/s].
        force_mean: Mean contact force in the last window [N].
        force_deviation: Its standard deviation [N].
    """
    if outcome != "completed":
        return "stopped"
    if speed_end <= REST_MM_PER_S:
        steady = force_deviation <= max(STEADY_N, STEADY_SHARE * force_mean)
        return "rests" if steady else "chatters"
    if speed_end >= FAST_MM_PER_S:
        return "runs away"
    ratio = speed_end / max(speed_before, 1e-9)
    if ratio >= GROWTH:
        return "grows"
    return "decays" if ratio <= DECAY else "oscillates"


AT_LIMIT = 1e-6
"""How near to its speed limit a tip counts as limited [m/s]."""
WINDOW_S = 2.0
"""The last two windows, in which the intention of a push rests, are compared."""
EVERY = 10
"""Rows of the trace for each that is kept of a curve."""


def magnitude(trace: Trace, block: str) -> Array:
    """Length of a vector at every tick (rows,); zeros if the trace has none."""
    return np.linalg.norm(trace.block(block), axis=1) if block in trace else np.zeros(len(trace))


def speed_limit(trace: Trace) -> float:
    """The controller's limit of the tip's speed along each axis [m/s]."""
    return float(trace.meta.scenario["controller"]["resolver"]["tip_speed_max_m_per_s"])


def speed_limited(trace: Trace) -> NDArray[np.bool_]:
    """Ticks at which the commanded velocity passes the controller's speed limit along some axis (rows,)."""
    most = speed_limit(trace)
    return np.asarray(np.max(np.abs(trace.block("velocity_command")), axis=1) > most + AT_LIMIT)


def _switches(on: Array) -> int:
    """How often a constraint begins to act."""
    return int(np.sum(np.diff((on > 0.0).astype(int)) == 1))


def _velocity_error(trace: Trace) -> float:
    """RMS of the tip's velocity against the command that has arrived, over all ticks [mm/s]."""
    error = tip_velocity(trace) - trace.block("velocity_command")
    return 1e3 * rms(np.linalg.norm(error, axis=1))


def shipped_measures(trace: Trace) -> Row:
    """A shipped scenario: accuracy, tanks, slack, constraints."""
    trace = trace.active()
    found = compute_metrics(trace)
    limited, planes = speed_limited(trace), trace["planes_active"]
    slack = magnitude(trace, "slack")
    fastest = float(np.max(np.abs(tip_velocity(trace))))
    return {
        "outcome": outcome(trace),
        "duration_s": float(trace["t_s"][-1]),
        "rcm_rms_mm": found["rcm_error_rms_mm"],
        "rcm_max_mm": found["rcm_error_max_mm"],
        "velocity_aligned_mm_per_s": found["velocity_error_rms_mm_per_s"],
        "velocity_unaligned_mm_per_s": found["velocity_error_unaligned_rms_mm_per_s"],
        "velocity_all_ticks_mm_per_s": _velocity_error(trace),
        "tank_min_j": found["tank_min_j"],
        "deficit_j": float(trace["tank_operator_deficit_j"][-1] + trace["tank_remote_deficit_j"][-1]),
        "passivity_percent": 100.0 * float(np.mean(trace["passivity_active"])),
        "force_scaled_percent": _force_scaled(trace),
        "planes_percent": 100.0 * float(np.mean(planes > 0.0)),
        "plane_contacts": _switches(planes),
        "plane_overshoot_mm": found["plane_overshoot_max_mm"],
        "speed_limit_percent": 100.0 * float(np.mean(limited)),
        "tip_speed_limit_mm_per_s": 1e3 * speed_limit(trace),
        "tip_speed_max_mm_per_s": 1e3 * fastest,
        "slack_max_mm_per_s": 1e3 * float(np.max(slack)),
        "slack_free_max_mm_per_s": _free_slack(trace, slack, limited),
        "rings_transferred": found.get("rings_transferred"),
        "ring_drops": found.get("ring_drops"),
        "energy_residual_percent": _percent(found["energy_residual_fraction"]),
    }


def _force_scaled(trace: Trace) -> float:
    """Share of the ticks in which the operator's tank cannot pay for the whole force [%]."""
    return 100.0 * float(np.mean(trace["force_scale"] < 1.0))


def _percent(fraction: float | None) -> float | None:
    return None if fraction is None else 100.0 * fraction


def _free_slack(trace: Trace, slack: Array, limited: NDArray[np.bool_]) -> float | None:
    """Largest slack while neither plane, budget nor speed limit acts [mm/s]."""
    free = ~limited & (trace["planes_active"] == 0.0) & (trace["passivity_active"] == 0.0)
    return 1e3 * float(np.max(slack[free])) if free.any() else None


def push_measures(trace: Trace, end_s: float, *, tanks: bool) -> Row:
    """A push that ends at `end_s` [s]: energy, how it ends, tracking and force feel.

    One that is stopped is measured until its stop.
    """
    trace = trace.active()
    speed = 1e3 * magnitude(trace, "handle_velocity")
    force, felt = magnitude(trace, "tip_force"), magnitude(trace, "master_force")
    t = trace["t_s"]
    last = t >= min(end_s, float(t[-1])) - WINDOW_S
    before = (t >= end_s - 2.0 * WINDOW_S) & (t < end_s - WINDOW_S)
    mean, deviation = float(np.mean(force[last])), float(np.std(force[last]))
    before_speed = rms(speed[before]) if before.any() else 0.0
    stock = _stock(trace) if tanks else 0.0
    delivered = float(np.max(trace["delivered_j"]))
    touched = mean > 0.1
    return {
        "outcome": outcome(trace),
        "end": steadiness(outcome(trace), before_speed, rms(speed[last]), mean, deviation),
        "handle_speed_before_mm_per_s": before_speed,
        "handle_speed_end_mm_per_s": rms(speed[last]),
        "handle_speed_max_mm_per_s": float(np.max(speed)),
        "contact_force_n": mean,
        "contact_deviation_n": deviation,
        "contact_max_n": float(np.max(force)),
        "master_force_n": float(np.mean(felt[last])),
        "force_ratio": float(np.mean(felt[last])) / mean if touched else None,
        "drift_end_mm": 1e3 * float(np.mean(trace["tip_error_m"][-100:])),
        "velocity_aligned_mm_per_s": _velocity_error(trace),
        "delivered_max_j": delivered,
        "beyond_stock_j": delivered - stock,
        "tank_min_j": _tank_min(trace) if tanks else None,
        "passivity_percent": 100.0 * float(np.nanmean(trace["passivity_active"])),
        "force_scaled_percent": _force_scaled(trace) if tanks else None,
        "rcm_rms_mm": 1e3 * rms(trace["rcm_error_m"]),
        "rcm_max_mm": 1e3 * float(np.max(trace["rcm_error_m"])),
    }


def guarded_measures(trace: Trace) -> Row:
    """What guards the remote tank, where it acts: what the tank and the limits make of it."""
    found = compute_metrics(trace.active())
    return {
        "outcome": outcome(trace),
        "duration_s": float(trace["t_s"][-1]),
        "tank_min_j": _tank_min(trace),
        "deficit_j": found["tank_deficit_j"],
        "beyond_stock_j": found["delivered_excess_j"],
        "acts_percent": 100.0 * float(np.nanmean(trace["passivity_active"])),
        "switches": _switches(np.nan_to_num(trace["passivity_active"])),
        "acceleration_ratio": found["acceleration_limit_ratio"],
        "relaxed_ticks": found["relaxed_ticks"],
        "contact_max_n": found["tip_force_max_n"],
    }


def _stock(trace: Trace) -> float:
    """Energy that the two tanks begin with [J]."""
    return 2.0 * float(trace.meta.scenario["task"]["bilateral"]["tanks"]["initial_j"])


def _tank_min(trace: Trace) -> float:
    return float(np.nanmin((trace["tank_operator_j"], trace["tank_remote_j"])))


def curves_over_time(trace: Trace) -> Curves:
    """Curves over time, SI units, 100 rows a second; flags and slack are the largest of each ten rows."""
    return {
        "t": _thin(trace["t_s"]),
        "tank_operator": _thin(trace["tank_operator_j"]),
        "tank_remote": _thin(trace["tank_remote_j"]),
        "slack": _largest(magnitude(trace, "slack")),
        "planes": _largest(trace["planes_active"]),
        "budget": _largest(trace["passivity_active"]),
        "scaled": _largest((trace["force_scale"] < 1.0).astype(float)),
        "speed": _largest(speed_limited(trace).astype(float)),
        "rcm": _largest(trace["rcm_error_m"]),
        "force": _thin(magnitude(trace, "tip_force")),
        "felt": _thin(magnitude(trace, "master_force")),
        "handle_speed": _thin(magnitude(trace, "handle_velocity")),
        "delivered": _thin(trace["delivered_j"]),
        "v_tip": _thin(tip_velocity(trace)[:, 0]),
        "v_command": _thin(trace.block("velocity_command")[:, 0]),
        "v_issued": _thin(trace.block("velocity_issued")[:, 0]),
    }


def _thin(values: Array) -> Array:
    return values[::EVERY].copy()


def _largest(values: Array) -> Array:
    """Largest of the rows that each kept row stands for."""
    filled = np.nan_to_num(values, nan=0.0)
    return np.maximum.reduceat(filled, np.arange(0, len(filled), EVERY))


def frontier_table(pushes: Sequence[Row]) -> list[Row]:
    """How each push ends, the worst over its seeds, and the smallest delay at which it is unstable."""
    keys = ("place", "grip", "link", "passivity")
    table: list[Row] = []
    delays = sorted({round(number(row, "delay_ms")) for row in pushes})
    for key, rows in groups(pushes, *keys).items():
        ends = {delay: worst(pick(rows, delay_ms=delay)) for delay in delays}
        unstable = [delay for delay, end in ends.items() if end in UNSTABLE]
        shown = {f"{delay}_ms": end for delay, end in ends.items()}
        named = dict(zip(keys, key, strict=True))
        table.append({**named, **shown, "unstable_from_ms": min(unstable, default=None)})
    return table


def worst(rows: Sequence[Row]) -> str | None:
    """The worst of the rows' ends; None without rows."""
    names: list[str] = [name for name in get_args(Steadiness) if name in {row["end"] for row in rows}]
    return names[-1] if names else None
