"""What a controller's parts see, as the record of a tick, and the same as objects for parts in Python."""

from weakref import WeakKeyDictionary

import numpy as np

from surgsim.control.problem import VelocityProblem
from surgsim.control.rcm import Rcm
from surgsim.models.arm import RCM_ROWS, ArmModel, Dynamics, Kinematics
from surgsim.models.build import JointLimits
from surgsim.plant.state import Wrench
from surgsim.tasks.command import command_of, fill_command_of
from surgsim.tick.arrays import Seen, new
from surgsim.tick.fields import Fields

_blanks: WeakKeyDictionary[ArmModel, dict[tuple[float, bool, float], Seen]] = WeakKeyDictionary()


def fill_constants(
    seen: Seen,
    arm: ArmModel,
    *,
    dt_s: float,
    has_trocar: bool,
    omega_gain: float,
    limit_zone_rad: float = 0.0,
    shared: bool = False,
) -> None:
    """Write what does not change over a run."""
    limits = arm.limits
    seen.dt_s, seen.omega_gain, seen.budget_j, seen.first = dt_s, omega_gain, np.inf, 1
    seen.has_trocar, seen.rows, seen.limit_zone = has_trocar, RCM_ROWS * has_trocar, limit_zone_rad
    seen.damping[:] = arm.damping
    seen.p_WC[:] = np.nan
    seen.q_min[:], seen.q_max[:], seen.v_max[:] = limits.q_min, limits.q_max, limits.velocity
    seen.a_max[:], seen.tau_max[:] = limits.acceleration, limits.torque
    arm.point(seen.elsewhere, shared=shared)


def new_seen(arm: ArmModel, *, dt_s: float, has_trocar: bool, omega_gain: float = 1.0) -> Seen:
    """A record for one call with `arm`, which must outlive it."""
    blanks = _blanks.setdefault(arm, {})
    blank = blanks.get((dt_s, has_trocar, omega_gain))
    if blank is None:
        blank = new(Seen, arm.limits.q_min.size)
        fill_constants(blank, arm, dt_s=dt_s, has_trocar=has_trocar, omega_gain=omega_gain, shared=True)
        blanks[dt_s, has_trocar, omega_gain] = blank
    return blank.copy()


def kinematics_of(seen: Fields) -> Kinematics:
    """A copy of the kinematics."""
    return Kinematics(
        p_WT=seen["p_WT"].copy(),
        R_WT=seen["R_WT"].copy(),
        Jv_WT=seen["Jv_WT"].copy(),
        Jw_WT=seen["Jw_WT"].copy(),
        p_WS=seen["p_WS"].copy(),
        Jv_WS=seen["Jv_WS"].copy(),
        z_W=seen["z_W"].copy(),
        anchors_W=seen["anchors_W"].copy(),
    )


def dynamics_of(seen: Fields) -> Dynamics:
    """A copy of the dynamics."""
    return Dynamics(mass_matrix=seen["M"].copy(), bias=seen["bias"].copy())


def rcm_of(seen: Fields) -> Rcm | None:
    """A copy of the RCM kinematics; None without a trocar."""
    if not seen["has_trocar"][0]:
        return None
    return Rcm(
        error=seen["rcm_error"].copy(),
        jacobian=seen["J_rcm"].copy(),
        trocar_velocity=seen["rcm_velocity"].copy(),
        normals=seen["normals"].copy(),
        depth=seen["depth"].item(),
    )


def wrench_of(seen: Fields) -> Wrench | None:
    """A copy of what the sensor at the flange measures; None without one."""
    if not seen["has_wrench"][0]:
        return None
    return Wrench(force=seen["f_S"].copy(), moment=seen["m_S"].copy())


def fill_wrench(seen: Seen, wrench: Wrench | None) -> None:
    """Write what the sensor at the flange measures into a record."""
    seen["has_wrench"] = wrench is not None
    if wrench is not None:
        seen["f_S"], seen["m_S"] = wrench.force, wrench.moment


def velocity_problem_of(seen: Fields, limits: JointLimits) -> VelocityProblem:
    """What a resolver in Python is given."""
    return VelocityProblem(
        t_s=seen["t_s"].item(),
        dt_s=seen["dt_s"].item(),
        q=seen["q"].copy(),
        v=seen["v"].copy(),
        kin=kinematics_of(seen),
        command=command_of(seen),
        rcm=rcm_of(seen),
        p_WC=seen["p_WC"].copy(),
        v_WC=seen["v_WC"].copy(),
        lower=seen["lower"].copy(),
        upper=seen["upper"].copy(),
        limits=limits,
        position_gain_per_s=seen["omega_gain"].item(),
        limit_zone_rad=seen["limit_zone"].item(),
        wrench=wrench_of(seen),
    )


def seen_of_velocity(problem: VelocityProblem, arm: ArmModel) -> Seen:
    """What a resolver is given, as a record for one call with `arm`, which must outlive it."""
    seen = new_seen(arm, dt_s=problem.dt_s, has_trocar=problem.rcm is not None)
    fill_velocity_problem(seen, problem)
    return seen


def fill_velocity_problem(seen: Seen, problem: VelocityProblem) -> None:
    """Write what a resolver is given into a record."""
    seen["t_s"], seen["dt_s"], seen["omega_gain"] = problem.t_s, problem.dt_s, problem.position_gain_per_s
    seen["limit_zone"] = problem.limit_zone_rad
    seen["q"], seen["v"] = problem.q, problem.v
    fill_kinematics(seen, problem.kin)
    fill_rcm_of(seen, problem.rcm)
    fill_command_of(seen, problem.command)
    seen["p_WC"], seen["v_WC"] = problem.p_WC, problem.v_WC
    seen["lower"], seen["upper"] = problem.lower, problem.upper
    limits = problem.limits
    seen["q_min"], seen["q_max"] = limits.q_min, limits.q_max
    seen["v_max"], seen["a_max"] = limits.velocity, limits.acceleration
    fill_wrench(seen, problem.wrench)


def fill_kinematics(seen: Seen, kin: Kinematics) -> None:
    """Write kinematics into a record."""
    seen["p_WT"], seen["R_WT"] = kin.p_WT, kin.R_WT
    seen["Jv_WT"], seen["Jw_WT"] = kin.Jv_WT, kin.Jw_WT
    seen["p_WS"], seen["Jv_WS"] = kin.p_WS, kin.Jv_WS
    seen["z_W"], seen["anchors_W"] = kin.z_W, kin.anchors_W


def fill_rcm_of(seen: Seen, rcm: Rcm | None) -> None:
    """Write RCM kinematics into a record, if there are any."""
    if rcm is None:
        return
    seen["rcm_error"], seen["J_rcm"], seen["rcm_velocity"] = rcm.error, rcm.jacobian, rcm.trocar_velocity
    seen["normals"], seen["depth"] = rcm.normals, rcm.depth
