"""Random problems for resolvers and torque laws: the same seed gives the same state and command."""

import numpy as np

from surgsim.array import Array
from surgsim.control.problem import Resolution, VelocityProblem, velocity_bounds
from surgsim.control.rcm import rcm_kinematics
from surgsim.control.torque_laws.base import TorqueProblem
from surgsim.models.arm import ArmModel, Kinematics
from surgsim.tasks.base import TipCommand

DT = 0.001
"""Control period of the problems [s]."""


def random_q(arm: ArmModel, rng: np.random.Generator) -> Array:
    """Joint positions (n,) inside the limits and away from singularities of tip and shaft rows [rad]."""
    while True:
        q: Array = 0.85 * rng.uniform(arm.limits.q_min, arm.limits.q_max)
        kin = arm.kinematics(q)
        rcm = rcm_kinematics(kin, kin.p_WT - 0.2 * kin.R_WT[:, 2], np.zeros(3))
        if np.linalg.svd(np.vstack([kin.Jv_WT, rcm.jacobian]), compute_uv=False)[-1] > 0.05:
            return q


def _trocar_point(kin: Kinematics, rng: np.random.Generator, rcm_error_m: float) -> Array:
    """A point at distance `rcm_error_m` from the shaft, 5 to 30 cm above the tip."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    normal = kin.R_WT @ np.array([np.cos(angle), np.sin(angle), 0.0])
    point: Array = kin.p_WT - rng.uniform(0.05, 0.3) * kin.R_WT[:, 2] + rcm_error_m * normal
    return point


def velocity_problem(
    arm: ArmModel,
    seed: int,
    *,
    trocar: bool = True,
    t_s: float = 0.0,
    dt_s: float = DT,
    rcm_error_m: float = 0.002,
    trocar_speed: float = 0.01,
    speed: float = 0.02,
    q: Array | None = None,
) -> VelocityProblem:
    """A random velocity problem.

    Args:
        arm: The arm.
        seed: Of the state and the command.
        trocar: Whether there is one.
        t_s: Time since the start [s].
        dt_s: Control period [s].
        rcm_error_m: Distance of the trocar point from the shaft [m].
        trocar_speed: Standard deviation of the trocar's velocity along each axis [m/s].
        speed: The same of the commanded tip velocity [m/s].
        q: Joint positions (n,) [rad]; random ones by default.
    """
    rng = np.random.default_rng(seed)
    q = random_q(arm, rng) if q is None else q
    kin = arm.kinematics(q)
    p_WC = _trocar_point(kin, rng, rcm_error_m) if trocar else np.full(3, np.nan)
    v_WC = trocar_speed * rng.standard_normal(3) if trocar else np.full(3, np.nan)
    lower, upper = velocity_bounds(q, arm.limits, 10.0)
    return VelocityProblem(
        t_s=t_s,
        dt_s=dt_s,
        q=q,
        v=0.1 * rng.standard_normal(q.size),
        kin=kin,
        command=TipCommand(
            p_WTd=kin.p_WT + 0.001 * rng.standard_normal(3),
            v_WTd=speed * rng.standard_normal(3),
            a_WTd=0.1 * rng.standard_normal(3),
        ),
        rcm=rcm_kinematics(kin, p_WC, v_WC) if trocar else None,
        p_WC=p_WC,
        v_WC=v_WC,
        lower=lower,
        upper=upper,
        limits=arm.limits,
        position_gain_per_s=10.0,
    )


def torque_problem(arm: ArmModel, seed: int, *, trocar: bool = True) -> TorqueProblem:
    """A random torque problem, on the state of the velocity problem of the same seed."""
    p = velocity_problem(arm, seed, trocar=trocar)
    rng, n = np.random.default_rng(seed + 1000), p.q.size
    return TorqueProblem(
        t_s=0.1,
        dt_s=p.dt_s,
        q=p.q,
        v=p.v,
        tau_measured=rng.standard_normal(n),
        kin=p.kin,
        dyn=arm.dynamics(p.q, p.v),
        rcm=p.rcm,
        p_WC=p.p_WC,
        v_WC=p.v_WC,
        command=p.command,
        resolution=Resolution(qdot=0.1 * rng.standard_normal(n), residual=0.0),
        q_ref=p.q + 0.01 * rng.standard_normal(n),
    )
