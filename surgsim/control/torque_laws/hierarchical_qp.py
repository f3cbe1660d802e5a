"""Hierarchical QP: RCM, tip and posture at torque level, with every limit of the arm as a row."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import Surroundings
from surgsim.compiled import compiled
from surgsim.control.acceleration import TORQUE_SHARE, fill_acceleration_bounds
from surgsim.control.barriers import fill_entry_barrier, fill_plane_barriers
from surgsim.control.elastic_observer import DELAY, ElasticObserverConfig, look_ahead, send
from surgsim.control.observer import delay_size, observer_size, remember_command
from surgsim.control.planes import PlaneConfig, plane_numbers
from surgsim.control.task_programs import solve_tasks
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.control.torque_laws.rcm_hierarchy import HIERARCHY_GAINS, fill_demand
from surgsim.control.torque_laws.rcm_inverse_dynamics import foresee, whole_share
from surgsim.control.torque_laws.rcm_tasks import RcmTasksConfig
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import back_substitute, dot, factor, times
from surgsim.tick.arrays import Seen
from surgsim.tick.nominal import copy_model
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, INFEASIBLE, RANK_LOST

KIND, RATE, RADIUS, POLES, WEIGHTS, FORESEEN = (HIERARCHY_GAINS + k for k in (0, 1, 2, 3, 5, 8))
"""Places of the gains that are this law's own: which observer, fastest torque, sphere, p1 and p2, weights of
RCM, tip and posture (0: strict priority); then as `foresee` wants them (3 + n,), the numbers of the elastic
observer (8 + 5n,), and the walls."""
NO_OBSERVER, MOMENTUM, ELASTIC = range(3)
MOTION, BIAS, DISTURBANCE, LIMITS, RELAXED = range(5)
"""Rows of the terms."""
TERMS = ("motion", "bias", "observer", "limits", "relaxed")


class HierarchicalQpConfig(RcmTasksConfig):
    """Quadratic programs for RCM over tip over posture, the limits of torque, rate and motion as rows.

    Attributes:
        mode: `strict` is a cascade in which no task costs one above it anything; `weighted` one program.
        rcm_weight: Of the RCM rows, `weighted` [s^4/m^2].
        tip_weight: Of the tip rows, `weighted` [s^4/m^2].
        posture_weight: Of the posture in the metric of the inertia, `weighted`.
        drive_share: On elastic drives all bandwidths are at most this share of the lowest sqrt(K / B_s).
        drive_damping_ratio: Damping of RCM and tip where that bounds their bandwidth.
        torque_rate_nm_per_s: Fastest change of a torque; null: what the arm's drives take [N m/s].
        entry_radius_m: Null: the RCM is a task. A number: it is a bound, the shaft stays within so much of
            the port, and the tip is the first task [m].
        planes: Virtual walls that the tip must not pass.
        barrier_poles_per_s: How fast a bound of sphere or walls may be approached, p1 and p2 [1/s].
        observer: What cancels disturbances: `none`; `momentum`, observer and delay prediction of
            `rcm_inverse_dynamics`; or `elastic`, those of `rcm_elastic_dynamics`.
        observer_gain: Of `momentum`, see `rcm_inverse_dynamics`.
        most_delay_ticks: Of `momentum`: longest delay that is recognised and predicted over.
        full_gain_delay_s: Of `momentum`: longest delay at which all gains are whole [s].
        elastic: Of `elastic`: what it observes with.
    """

    type: Literal["hierarchical_qp"] = "hierarchical_qp"
    mode: Literal["strict", "weighted"] = "strict"
    rcm_weight: PositiveFloat = 10.0
    tip_weight: PositiveFloat = 1.0
    posture_weight: PositiveFloat = 1e-5
    drive_share: PositiveFloat = 0.25
    drive_damping_ratio: PositiveFloat = 0.5
    torque_rate_nm_per_s: PositiveFloat | None = None
    entry_radius_m: PositiveFloat | None = None
    planes: tuple[PlaneConfig, ...] = ()
    barrier_poles_per_s: tuple[PositiveFloat, PositiveFloat] = (20.0, 100.0)
    observer: Literal["none", "momentum", "elastic"] = "none"
    observer_gain: Annotated[float, Field(ge=0.0, le=1.0)] = 0.3
    most_delay_ticks: Annotated[int, Field(ge=0, le=1000)] = 20
    full_gain_delay_s: PositiveFloat = 0.01
    elastic: ElasticObserverConfig = ElasticObserverConfig()

    def check(self, scenario: Surroundings) -> None:
        """Refuse control periods over which the gears cannot be followed."""
        if self.observer == "elastic":
            self.elastic.check(scenario)

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law; memory: last torque (n,), the observer's, sides of the last program."""
        n = arm.limits.torque.size
        rate = np.inf if arm.drive is None else arm.drive.torque_rate
        radius = self.entry_radius_m or 0.0
        weights = (self.rcm_weight, self.tip_weight, self.posture_weight)
        kind = ("none", "momentum", "elastic").index(self.observer)
        motors = np.zeros(n) if arm.drive is None else arm.drive.apparent_inertia
        gains = np.concatenate(
            [
                self.bounded_gains(self.drive_share * arm.locked_frequency, self.drive_damping_ratio),
                (kind, self.torque_rate_nm_per_s or rate, radius, *self.barrier_poles_per_s),
                weights if self.mode == "weighted" else (0.0, 0.0, 0.0),
                (self.observer_gain, self.most_delay_ticks, self.full_gain_delay_s, *motors),
                self.elastic.numbers(arm),
                plane_numbers(self.planes),
            ]
        )
        kept = (0, observer_size(n) + delay_size(n, self.most_delay_ticks), self.elastic.memory_size(n))[kind]
        limits = 2 * n + 1 + len(self.planes)
        return KernelTorqueLaw(
            kernel=hierarchical_qp,
            arm=arm,
            terms=TERMS,
            gains=gains,
            memory_size=n + kept + limits + 5,
            failures={INFEASIBLE: "the programs of the hierarchy have no answer"},
        )


@compiled
def _tell_what_gave_way(
    M: Array, barriers: Array, qddot: Array, least: Array, most: Array, relaxed: Array
) -> None:
    """Fill `relaxed` (n,) [N m]: the torque by which q'' (n,) is past bounds that gave way.

    Of bounds of q'' M times what is beyond them; of a row g of sphere or walls g (g . q'' - most) /
    (g M^-1 g), the least torque that would bring it back.
    """
    n = qddot.size
    beyond, L, y = scratch(n), scratch_matrix(n, n), scratch(n)
    for i in range(n):
        beyond[i] = qddot[i] - min(max(qddot[i], least[i]), most[i])
    times(M, beyond, relaxed)
    L[:] = M
    if not factor(L):
        return
    for k in range(barriers.shape[0]):
        by = dot(barriers[k], qddot) - most[2 * n + k]
        y[:] = barriers[k]
        back_substitute(L, y)
        weight = dot(barriers[k], y)
        if by > 0.0 and weight > 0.0:
            for i in range(n):
                relaxed[i] += barriers[k, i] * by / weight


@compiled
def _fill_terms(
    gains: Array,
    seen: Seen,
    planes: Array,
    last: Array,
    sides: Array,
    late: float,
    share: float,
    d: Array,
    out: Array,
) -> int:
    """Fill the terms of the torque for the state of `seen.elsewhere`, reached `late` [s] from now."""
    model, n, m, walls = seen.elsewhere, seen.q.size, 3 + seen.rows, planes.size // 4
    J, a, posture, qddot, free = scratch_matrix(m, n), scratch(m), scratch(n), scratch(n), scratch(n)
    fill_demand(gains, seen, model, late, share, J, a, posture)
    sphere = gains[RADIUS] > 0.0 and seen.rows > 0
    if sphere:
        m = 3
    for i in range(n):
        out[BIAS, i] = model.bias[i] + seen.damping[i] * model.v[i]
        out[DISTURBANCE, i] = -d[i]
    held = n + walls + (1 if sphere else 0)
    rows, lower, upper = np.empty((held + m, n)), np.empty(n + held + m), np.empty(n + held + m)
    fill_acceleration_bounds(seen, model.q, model.v, lower[:n], upper[:n])
    lower[n:], upper[n:], rows[:n] = -np.inf, np.inf, model.M
    most = gains[RATE] * seen.dt_s
    for i in range(n):
        h, limit = out[BIAS, i] - d[i], TORQUE_SHARE * seen.tau_max[i]
        near = min(max(last[i], -limit), limit)
        lower[n + i], upper[n + i] = max(-limit, near - most) - h, min(limit, near + most) - h
    poles = gains[POLES : POLES + 2]
    fill_plane_barriers(planes, model, poles, rows[n : n + walls], upper[2 * n : 2 * n + walls])
    if sphere:
        upper[n + held - 1] = fill_entry_barrier(seen, model, late, gains[RADIUS], poles, rows[held - 1])
    asked = upper[: n + held].copy()
    least = lower[:n].copy()
    weights = gains[WEIGHTS : WEIGHTS + 3]
    status, gave_way = solve_tasks(
        model.M,
        J[:m],
        a[:m],
        posture,
        weights,
        rows,
        held,
        n,
        lower,
        upper,
        sides[: n + held + m],
        qddot,
        free,
    )
    if status != GOES_ON:
        return status
    times(model.M, free, out[MOTION])
    times(model.M, qddot, out[LIMITS])
    out[RELAXED] = 0.0
    if gave_way:
        _tell_what_gave_way(model.M, rows[n:held], qddot, least, asked, out[RELAXED])
    for i in range(n):
        out[LIMITS, i] -= out[MOTION, i] + out[RELAXED, i]
    return GOES_ON


@compiled
def hierarchical_qp(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Tau = M q'' + bias + D q' - d with the q'' that tasks and limits leave.

    The tasks ask for the accelerations of `rcm_inverse_dynamics`: rows J_r q'' = a_r of the RCM, J_t q'' =
    a_t of the tip, posture q''_p. The limits are rows, tau being eliminated:

        |M q'' + h| <= tau_max,  |M q'' + h - tau_last| <= rate T,  h = bias + D q' - d
        velocity and position limits as bounds of q''  (`fill_acceleration_bounds`)
        sphere and walls, if there are any               (`surgsim.control.barriers`)

    `strict`: min |J_r q'' - a_r|, of its minimisers min |J_t q'' - a_t|, of theirs min |q'' - q''_p|_M.
    `weighted`: min w_r |J_r q'' - a_r|^2 + w_t |J_t q'' - a_t|^2 + w_p |q'' - q''_p|_M^2.

    Torque and rate are the drives' and never give way. Where they exclude the other limits, bounds of q''
    give way before sphere and walls are looked at, and those last, each by the least squares that the ones
    above leave (`surgsim.control.relaxation`). The row `relaxed` is the torque by which q'' is past its
    bounds of velocity and position, zero where it keeps them; `limits` is what all limits changed besides.

    Rows motion, bias, observer, limits, relaxed (5, n) [N m].

    Source: strict, Kanoun, Lamiraux and Wieber, IEEE T-RO 27:785 (2011), and Escande, Mansard and Wieber,
    IJRR 33:1006 (2014); weighted, with tau eliminated, Del Prete et al., TSID (2016). They have no observer.
    """
    n, kind = seen.q.size, gains[KIND]
    d, touch, late, share = scratch(n), scratch(n), 0.0, 1.0
    numbers, elastic = gains[FORESEEN : FORESEEN + 3 + n], gains[FORESEEN + 3 + n : FORESEEN + 11 + 6 * n]
    planes = gains[FORESEEN + 11 + 6 * n :]
    begin = memory.size - (2 * n + 6 + planes.size // 4)
    last, observed, sides = memory[:n], memory[n:begin], memory[begin:]
    d[:], touch[:] = 0.0, 0.0
    if seen.first != 0:
        last[:] = seen.tau
    if kind == ELASTIC:
        status = look_ahead(elastic, seen, observed, touch, d)
        if status != GOES_ON:
            return status
        late = elastic[DELAY] * seen.dt_s
    elif kind == MOMENTUM:
        late = foresee(numbers, seen, observed, touch, d)
        if late < 0.0:
            return RANK_LOST
        share = whole_share(numbers, late)
    else:
        copy_model(seen, seen.elsewhere)
    status = _fill_terms(gains, seen, planes, last, sides, late, share, d, out)
    if status != GOES_ON:
        return status
    if kind == ELASTIC:
        send(elastic, seen, observed, out, LIMITS)
    for i in range(n):
        last[i] = 0.0
        for k in range(out.shape[0]):
            last[i] += out[k, i]
    if kind == MOMENTUM:
        remember_command(observed[n * (n + 3) :], int(numbers[1]), last)
    return GOES_ON
