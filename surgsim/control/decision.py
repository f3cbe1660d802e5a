"""A controller's tick as a kernel: correction and nominal model, port, resolver, torque law, joint reference.

What a controller's parts see is written here alone.
"""

from functools import cache
from typing import Any

from numba import types

from surgsim.compiled import call_at, compiled
from surgsim.control.bounds import fill_velocity_bounds
from surgsim.control.limit_avoidance import keep_from_limits
from surgsim.control.rcm import fill_rcm
from surgsim.tick.arrays import Control, Seen, World, type_of
from surgsim.tick.nominal import copy_model, dynamics, kinematics
from surgsim.tick.rigid import exponential
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import doubles, numbers

ESTIMATOR, SOLVER, LAW, INSTRUMENT = range(4)
"""Values of `Control.who`."""


@cache
def decide_signature(n: int) -> Any:
    """Status = decide(control)."""
    return types.int64(type_of(Control, n))


@compiled
def measure(seen: Seen, world: World) -> None:
    """Hand what is measured to the controller, before it decides."""
    seen.t_s = world.t_s
    for i in range(world.q.size):
        seen.q[i], seen.v[i], seen.tau[i] = world.q_m[i], world.v_m[i], world.tau_m[i]
    for i in range(3):
        seen.f_T[i], seen.p_WC[i] = world.f_T_m[i], world.p_WC_m[i]
        seen.v_WC[i], seen.a_WC[i] = world.v_WC_m[i], 0.0
    seen.has_wrench = world.has_wrench
    if world.has_wrench:
        seen.f_S[:] = world.f_S_m
        seen.m_S[:] = world.m_S_m
    seen.tracked_samples = world.tracked_samples
    if world.tracked_samples > 0:
        seen.tracked_age_s = world.tracked_age_s
        seen.p_WT_m[:] = world.p_WT_m
        seen.R_WT_m[:] = world.R_WT_m


@compiled
def forget(c: Control) -> None:
    """The next tick is the first; what is known of the instrument stays."""
    c.seen.first = 1


@compiled
def decide(c: Control) -> int:
    """Fill the answers in `c` from the measured state and the command in it."""
    seen, minds = c.seen, c.minds
    _refer(c)
    if c.corrects:
        status: int = _correct(c)
        if status != GOES_ON:
            return status
    kinematics(c.measured, seen.q)
    if c.has_law:
        dynamics(c.measured, seen.v)
    c.measured.v[:] = seen.v
    copy_model(c.measured, seen)
    c.who = ESTIMATOR
    port = doubles(c.port.ctypes.data, 3, 3)
    status = call_at(minds.port, numbers(minds.port_gains), seen, numbers(minds.port_memory), port)
    if status != GOES_ON:
        return status
    _see_port(c)
    _see_command(c)
    c.who = SOLVER
    gains, memory = numbers(minds.resolver_gains), numbers(minds.resolver_memory)
    if c.at_reference:
        asked = _referred(c)
    else:
        _bound(seen)
        asked = seen
    status = call_at(minds.resolver, gains, asked, memory, c.resolved)
    if status != GOES_ON:
        return status
    if c.adds_avoidance:
        keep_from_limits(asked, c.resolved)
    c.torque[:] = 0.0
    if c.has_law:
        c.who = LAW
        seen.qdot_ref[:] = c.resolved.qdot
        seen.p_WTd[:] = c.resolved.p_WTd
        seen.v_WTd[:] = c.resolved.v_WTd
        seen.a_WTd[:] = c.resolved.a_WTd
        n = c.torque.size
        terms = doubles(minds.terms.address, minds.terms.length // n, n)
        status = call_at(minds.law, numbers(minds.law_gains), seen, numbers(minds.law_memory), terms)
        if status != GOES_ON:
            return status
        for i in range(terms.shape[0]):
            for j in range(n):
                c.torque[j] += terms[i, j]
    seen.first = 0
    return GOES_ON


@compiled
def _correct(c: Control) -> int:
    """Ask the instrument estimator, and correct every nominal model that a part may evaluate."""
    minds, p, R = c.minds, scratch(3), scratch_matrix(3, 3)
    c.who = INSTRUMENT
    twist = doubles(c.correction.ctypes.data, 2, 3)
    status: int = call_at(
        minds.instrument, numbers(minds.instrument_gains), c.seen, numbers(minds.instrument_memory), twist
    )
    if status == GOES_ON:
        exponential(twist[0], twist[1], p, R)
        for model in (c.measured, c.reference, c.seen.elsewhere, c.referred.elsewhere):
            model.corrected = 1
            model.p_NT[:] = p
            model.R_NT[:] = R
    return status


@compiled
def _refer(c: Control) -> None:
    """The joint reference of this tick: moved by the resolver's last answer, inside the range."""
    seen = c.seen
    if seen.first:
        seen.q_ref[:] = seen.q
        seen.qdot_ref[:] = seen.v
        numbers(c.minds.port_memory)[:] = 0.0
        numbers(c.minds.resolver_memory)[:] = 0.0
        numbers(c.minds.law_memory)[:] = 0.0
    else:
        for i in range(seen.q.size):
            moved = seen.q_ref[i] + seen.dt_s * c.resolved.qdot[i]
            seen.q_ref[i] = min(max(moved, seen.q_min[i]), seen.q_max[i])
            seen.qdot_ref[i] = c.resolved.qdot[i]
    c.q_ref[:] = seen.q_ref


@compiled
def _see_port(c: Control) -> None:
    """Estimate and shift of the remote centre, and the RCM's kinematics."""
    seen, port = c.seen, c.port
    for i in range(3):
        seen.p_WC[i] = port[0, i] + c.command.rcm_shift[i]
        seen.v_WC[i] = port[1, i] + c.command.rcm_shift_rate[i]
        seen.a_WC[i] = port[2, i]
    if seen.has_trocar:
        _rcm(seen)


@compiled
def _see_command(c: Control) -> None:
    """What the parts are told to do; the torque law follows it too, unless the resolver writes another."""
    seen, command, out = c.seen, c.command, c.resolved
    seen.roll_rate, seen.jaw, seen.budget_j = command.roll_rate, command.jaw, command.budget_j
    for i in range(3):
        seen.budget_f_T[i] = command.budget_f_T[i]
        seen.p_WTd[i] = out.p_WTd[i] = command.p_WTd[i]
        seen.v_WTd[i] = out.v_WTd[i] = command.v_WTd[i]
        seen.a_WTd[i] = out.a_WTd[i] = command.a_WTd[i]


@compiled
def _referred(c: Control) -> Seen:
    """What a resolver sees that is evaluated at the joint reference."""
    seen, other = c.seen, c.referred
    kinematics(c.reference, seen.q_ref)
    c.reference.v[:] = seen.qdot_ref
    copy_model(c.reference, other)
    other.t_s, other.first, other.budget_j = seen.t_s, seen.first, seen.budget_j
    other.roll_rate, other.jaw = seen.roll_rate, seen.jaw
    other.tau[:] = seen.tau
    other.tracked_samples, other.tracked_age_s = seen.tracked_samples, seen.tracked_age_s
    other.has_wrench = seen.has_wrench
    other.f_S[:] = seen.f_S
    other.m_S[:] = seen.m_S
    other.p_WT_m[:] = seen.p_WT_m
    other.R_WT_m[:] = seen.R_WT_m
    other.q_ref[:] = seen.q_ref
    other.qdot_ref[:] = seen.qdot_ref
    for i in range(3):
        other.f_T[i], other.budget_f_T[i] = seen.f_T[i], seen.budget_f_T[i]
        other.p_WC[i], other.v_WC[i], other.a_WC[i] = seen.p_WC[i], seen.v_WC[i], seen.a_WC[i]
        other.p_WTd[i], other.v_WTd[i], other.a_WTd[i] = seen.p_WTd[i], seen.v_WTd[i], seen.a_WTd[i]
    if other.has_trocar:
        _rcm(other)
    _bound(other)
    return other


@compiled
def _bound(seen: Seen) -> None:
    gain = seen.omega_gain
    fill_velocity_bounds(seen.q, seen.q_min, seen.q_max, seen.v_max, gain, seen.lower, seen.upper)


@compiled
def _rcm(seen: Seen) -> None:
    r = seen
    r.depth = fill_rcm(
        r.p_WS, r.R_WT, r.Jv_WS, r.Jw_WT, r.p_WC, r.v_WC, r.rcm_error, r.J_rcm, r.rcm_velocity, r.normals
    )
