"""Rows of the tables: what a trace says."""

import numpy as np
from numpy.typing import NDArray

from surgsim.metrics.accuracy import rms
from surgsim.metrics.catalog import compute_metrics
from surgsim.metrics.teleoperation import tip_velocity
from surgsim.studies.passive_teleoperation.cases import WINDOW_S, Push, Shipped
from surgsim.studies.passive_teleoperation.stability import steadiness
from surgsim.studies.study import Cell, Row
from surgsim.trace.trace import Trace

Array = NDArray[np.float64]
AT_LIMIT = 1e-6
"""How near to its speed limit a tip counts as limited [m/s]."""


def outcome(trace: Trace) -> str:
    """How the run ended."""
    return trace.meta.ending.outcome.name.lower()


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


def _velocity_errors(trace: Trace) -> dict[str, Cell]:
    error = tip_velocity(trace) - trace.block("velocity_command")
    return {"velocity_all_ticks_mm_per_s": 1e3 * rms(np.linalg.norm(error, axis=1))}


def shipped_row(case: Shipped, trace: Trace) -> Row:
    """A shipped scenario: accuracy, tanks, slack, constraints."""
    trace = trace.active()
    found = compute_metrics(trace)
    limited, planes = speed_limited(trace), trace["planes_active"]
    slack = magnitude(trace, "slack")
    fastest = float(np.max(np.abs(tip_velocity(trace))))
    return {
        "scenario": case.name,
        "outcome": outcome(trace),
        "duration_s": float(trace["t_s"][-1]),
        "rcm_rms_mm": found["rcm_error_rms_mm"],
        "rcm_max_mm": found["rcm_error_max_mm"],
        "velocity_aligned_mm_per_s": found["velocity_error_rms_mm_per_s"],
        "velocity_unaligned_mm_per_s": found["velocity_error_unaligned_rms_mm_per_s"],
        **_velocity_errors(trace),
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


def push_row(case: Push, trace: Trace) -> Row:
    """A push: energy, how it ends, tracking and force feel; a stopped one until its stop."""
    trace = trace.active()
    speed = 1e3 * magnitude(trace, "handle_velocity")
    force, felt = magnitude(trace, "tip_force"), magnitude(trace, "master_force")
    t, end_s = trace["t_s"], case.duration_s
    last = t >= min(end_s, float(t[-1])) - WINDOW_S
    before = (t >= end_s - 2.0 * WINDOW_S) & (t < end_s - WINDOW_S)
    mean, deviation = float(np.mean(force[last])), float(np.std(force[last]))
    before_speed = rms(speed[before]) if before.any() else 0.0
    stock = _stock(trace) if case.passivity == "tank" else 0.0
    delivered = float(np.max(trace["delivered_j"]))
    touched = mean > 0.1
    return {
        "place": case.place,
        "grip": case.grip,
        "link": case.link,
        "seed": case.seed,
        "delay_ms": case.delay_ms,
        "passivity": case.passivity,
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
        "drift_end_mm": 1e3 * float(np.mean(trace.active()["tip_error_m"][-100:])),
        "velocity_aligned_mm_per_s": _velocity_errors(trace.active())["velocity_all_ticks_mm_per_s"],
        "delivered_max_j": delivered,
        "beyond_stock_j": delivered - stock,
        "tank_min_j": _tank_min(trace) if case.passivity == "tank" else None,
        "passivity_percent": 100.0 * float(np.nanmean(trace["passivity_active"])),
        "force_scaled_percent": _force_scaled(trace) if case.passivity == "tank" else None,
        "rcm_rms_mm": 1e3 * rms(trace["rcm_error_m"]),
        "rcm_max_mm": 1e3 * float(np.max(trace["rcm_error_m"])),
    }


def _stock(trace: Trace) -> float:
    """Energy that the two tanks begin with [J]."""
    return 2.0 * float(trace.meta.scenario["task"]["tanks"]["initial_j"])


def _tank_min(trace: Trace) -> float:
    return float(np.nanmin((trace["tank_operator_j"], trace["tank_remote_j"])))
