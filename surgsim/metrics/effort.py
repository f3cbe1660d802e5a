"""How near the arm came to its limits, and how much the controller left unmet."""

import numpy as np

from surgsim.metrics.accuracy import rms
from surgsim.metrics.metric import CHOICE, Metric
from surgsim.trace.trace import Trace


def joint_limit_margin_min_rad(trace: Trace) -> float:
    """Smallest distance of any joint from its position limit [rad]; negative outside."""
    q = trace.block("q")
    low, high = np.array(trace.meta.limits["q_min"]), np.array(trace.meta.limits["q_max"])
    return float(np.min(np.minimum(q - low, high - q)))


def joint_velocity_ratio_max(trace: Trace) -> float:
    """Largest |joint velocity| over its limit."""
    return float(np.max(np.abs(trace.block("v")) / np.array(trace.meta.limits["velocity"])))


def torque_ratio_max(trace: Trace) -> float:
    """Largest |joint torque| over its limit; NaN on the kinematic plant."""
    ratio = np.abs(trace.block("tau")) / np.array(trace.meta.limits["torque"])
    return float(np.nanmax(ratio)) if np.isfinite(ratio).any() else float("nan")


def torque_peak_nm(trace: Trace) -> float:
    """Largest |joint torque| [N m]; NaN on the kinematic plant."""
    tau = trace.block("tau")
    return float(np.nanmax(np.abs(tau))) if np.isfinite(tau).any() else float("nan")


def torque_total_mean_nm(trace: Trace) -> float:
    """Mean over time of the Euclidean norm of the joint torques [N m]; NaN on the kinematic plant."""
    total = np.linalg.norm(trace.block("tau"), axis=1)
    total = total[np.isfinite(total)]
    return float(np.mean(total)) if total.size else float("nan")


def saturated_fraction(trace: Trace) -> float:
    """Fraction of ticks in which a commanded torque was cut at its limit; NaN on the kinematic plant."""
    saturated = trace["saturated_joints"]
    saturated = saturated[np.isfinite(saturated)]
    return float(np.mean(saturated > 0)) if saturated.size else float("nan")


def motor_loss_j(trace: Trace) -> float:
    """Energy lost in the motors' friction and in the gears [J]; NaN on ideal drives."""
    return float(trace["drive_loss_j"][-1]) if "drive_loss" in trace else float("nan")


def resolver_residual_rms(trace: Trace) -> float:
    """RMS norm of the task and RCM rows that the resolver left unmet [m/s]."""
    residual = trace["resolver_residual_m_per_s"]
    residual = residual[np.isfinite(residual)]
    return rms(residual) if residual.size else float("nan")


METRICS = (
    Metric(
        name="joint_limit_margin_min_rad",
        heading="margin to the joint limits, smallest [rad]",
        matters=0.01,
        matters_source=CHOICE,
        meaning="smallest distance of a joint from its position limit",
        compute=joint_limit_margin_min_rad,
        lower_is_better=False,
    ),
    Metric(
        name="joint_velocity_ratio_max",
        heading="joint velocity over its limit, largest",
        matters=0.01,
        matters_source=CHOICE,
        meaning="largest joint velocity over its limit",
        compute=joint_velocity_ratio_max,
    ),
    Metric(
        name="torque_ratio_max",
        heading="joint torque over its limit, largest",
        matters=0.01,
        matters_source=CHOICE,
        meaning="largest joint torque over its limit",
        compute=torque_ratio_max,
    ),
    Metric(
        name="torque_peak_nm",
        heading="joint torque, largest [N m]",
        matters=0.1,
        matters_source=CHOICE,
        meaning="largest joint torque, N m",
        compute=torque_peak_nm,
    ),
    Metric(
        name="torque_total_mean_nm",
        heading="norm of the joint torques, mean [N m]",
        matters=0.1,
        matters_source=CHOICE,
        meaning="mean over time of the norm of the joint torques, N m",
        compute=torque_total_mean_nm,
    ),
    Metric(
        name="saturated_fraction",
        heading="ticks with a torque at its limit, share",
        matters=0.01,
        matters_source=CHOICE,
        meaning="fraction of ticks with a torque cut at its limit",
        compute=saturated_fraction,
    ),
    Metric(
        name="motor_loss_j",
        heading="energy lost in motors and gears [J]",
        matters=0.1,
        matters_source=CHOICE,
        meaning="energy lost in the friction of the motors and in the gears, J",
        compute=motor_loss_j,
    ),
    Metric(
        name="resolver_residual_rms",
        heading="velocity left unmet, RMS [m/s]",
        matters=1e-4,
        matters_source=CHOICE,
        meaning="RMS of the velocity rows that the resolver left unmet, m/s",
        compute=resolver_residual_rms,
    ),
    Metric(
        name="infeasible_ticks",
        heading="ticks without a command",
        meaning="ticks in which the controller found no command",
        compute=lambda trace: float(np.sum(trace["infeasible"] == 1.0)),
    ),
)
