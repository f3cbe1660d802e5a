"""Where an arm on elastic drives is and will be, and what disturbs its links and its motors.

All of it from joint positions, gear torques and the commands that were sent. The model is that of
`surgsim.models.drive`, in q (links), v, the gears' deflection s = theta - q, and w (motors),

    M v' + c + D_l v = K s + d                         d: disturbance torque on the links
    B_s w' = u - K s - D_s (w - v) - f                 f: on the motors, behind the torque loop
    q' = v,  s' = w - v

stepped over a control period T by the trapezoidal rule, M and c as they were predicted for its beginning.
With beta = B_s/T, kappa = K T/4, mu = kappa + D_s/2 the motors are eliminated,

    w+ = (P + mu v+)/(beta + mu),   P = beta w + u - f - K s - mu (w - v)
    (M/T + D_l/2 + kappa beta/(beta + mu)) v+
        = M v/T - c + d - D_l v/2 + K s + kappa (w - v) + kappa P/(beta + mu)

A link that is lighter than K T^2 could oscillate against its gear within a period: it is taken to have that
inertia. The step is corrected by what is measured, e_q = q_m - q and e_s = tau_m/K - s,

    q += a e_q,  v += b e_q/T,  d += g M e_q/T^2
    s += a' e_s, w += b' (e_q + e_s)/T,  f_r -= g' B_s (e_q + e_s)/T^2

with the gains of filters of third order (`filter_gains`), so that velocities are never differentiated, and
the links' d and the motors' f are told apart: the one shows in the links' motion, the other in the motors'.
Of f = f_r + F y the second part is dry friction against the reference motion, y = q_ref'/band within -1 and
1, whose size is learnt where the joint moves: F' = learning f_r y, F >= 0. So it turns round with the motion,
not after it.

Source: the disturbance model of Ott, Cartesian Impedance Control of Redundant and Flexible-Joint Robots
(2008); the gains by pole placement, as of the g-h-k filters in Brookner, Tracking and Kalman Filtering Made
Easy (1998); the learning is a gradient law, as in Canudas de Wit et al., IEEE J. Robotics and Automation
3:681 (1987).
"""

import math
from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig, Surroundings
from surgsim.compiled import compiled
from surgsim.control.filters import filter_gains
from surgsim.models.arm import ArmModel
from surgsim.models.drive import Drive
from surgsim.tick.algebra import back_substitute, factor, times
from surgsim.tick.arrays import Seen
from surgsim.tick.nominal import dynamics, kinematics
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, RANK_LOST

Q, V, S, W, LINK, MOTOR, REST, DRY, FRICTION = range(9)
"""Rows of the memory (n,): the state, d, f_r, -c, F, F y; after them M (n, n), then the commands sent."""
ROWS = 9
LINK_STATE, LINK_CUTOFF, MOTOR_STATE, MOTOR_CUTOFF, BAND, LEARNING, DELAY, RATE = range(8)
"""Places of the numbers; after them the rows of the drives."""
DRIVES = 8
STIFFNESS, APPARENT, LOOP, DAMPING, ARMATURE = range(5)
"""Rows of the drives (5, n): K, B_s, D_s, D_l, and B_s as it is part of the nominal inertia."""
LONGEST_PERIOD_S = 0.004
"""Control period up to which the gears can be followed [s]."""


class ElasticObserverConfig(PartConfig):
    """What a law on elastic drives observes with, and how far it looks ahead.

    Attributes:
        link_state_hz: Cut-off of the links' positions and velocities [Hz].
        link_observer_hz: Cut-off of the disturbance torque on the links [Hz].
        motor_state_hz: Cut-off of the motors' positions and velocities [Hz].
        motor_observer_hz: Cut-off of the disturbance torque on the motors [Hz].
        friction_band_rad_per_s: Reference velocity past which dry friction is taken to be whole [rad/s].
        friction_learning_per_s: How fast the size of the dry friction is learnt [1/s]; 0: not at all.
        delay_ticks: Control periods between command and torque that are predicted over.
        stiffness_factor: A model error on purpose: what is taken for K, over the drives' own.
        inertia_factor: The same of B_s.
    """

    link_state_hz: PositiveFloat = 24.0
    link_observer_hz: PositiveFloat = 9.0
    motor_state_hz: PositiveFloat = 36.0
    motor_observer_hz: PositiveFloat = 50.0
    friction_band_rad_per_s: PositiveFloat = 0.002
    friction_learning_per_s: NonNegativeFloat = 10.0
    delay_ticks: Annotated[int, Field(ge=0, le=50)] = 2
    stiffness_factor: PositiveFloat = 1.0
    inertia_factor: PositiveFloat = 1.0

    def check(self, scenario: Surroundings) -> None:
        """Refuse control periods over which the gears cannot be followed."""
        if scenario.control_period_s > LONGEST_PERIOD_S:
            raise ValueError(
                f"a torque law that follows elastic gears needs a control_period_s of at most "
                f"{LONGEST_PERIOD_S:g}, not {scenario.control_period_s:g}"
            )

    def numbers(self, arm: ArmModel) -> Array:
        """The observer's numbers for an arm; ideal drives are taken for stiff ones with light motors."""
        n = arm.limits.torque.size
        drive = arm.drive or _as_good_as_rigid(n)
        own = (
            self.link_state_hz,
            self.link_observer_hz,
            self.motor_state_hz,
            self.motor_observer_hz,
            self.friction_band_rad_per_s,
            self.friction_learning_per_s,
            float(self.delay_ticks),
            drive.torque_rate,
        )
        part_of_inertia = np.zeros(n) if arm.drive is None else drive.apparent_inertia
        inertia = self.inertia_factor * drive.apparent_inertia
        stiffness = self.stiffness_factor * drive.stiffness
        rows = (stiffness, inertia, drive.loop_damping, arm.damping, part_of_inertia)
        return np.concatenate([own, *rows])

    def memory_size(self, n: int) -> int:
        """Length of the memory for n joints."""
        return n * (ROWS + n + self.delay_ticks + 1)


def _as_good_as_rigid(n: int) -> Drive:
    """Drives of n joints that a control period of a millisecond cannot tell from ideal ones."""
    stiffness, inertia = np.full(n, 3e4), np.full(n, 1e-3)
    return Drive(
        stiffness=stiffness,
        gear_damping=np.zeros(n),
        rotor_inertia=inertia,
        apparent_inertia=inertia,
        loop_damping=np.sqrt(stiffness * inertia),
        torque_rate=math.inf,
    )


@compiled
def look_ahead(numbers: Array, seen: Seen, memory: Array, touch: Array, d: Array) -> int:
    """Evaluate `seen.elsewhere` where the arm will be when the next command acts.

    Args:
        numbers: Of `ElasticObserverConfig.numbers`.
        seen: What is measured.
        memory: State, disturbances and commands.
        touch: Measured torque of the surroundings on the links, which the observer need not find (n,) [N m].
        d: Filled with d - f, `touch` in it (n,) [N m].
    """
    n, dt, delay = seen.q.size, seen.dt_s, int(numbers[DELAY])
    rows, M = memory[: ROWS * n].reshape((ROWS, n)), memory[ROWS * n : (ROWS + n) * n].reshape((n, n))
    sent, drives = memory[(ROWS + n) * n :].reshape((delay + 1, n)), numbers[DRIVES:].reshape((5, n))
    x, rest, f, L = scratch_matrix(4, n), scratch(n), scratch(n), scratch_matrix(n, n)
    if seen.first:
        _begin(drives, seen, touch, rows, M, sent)
    if not factor_step(drives, M, dt, L):
        return RANK_LOST
    for i in range(n):
        rest[i], f[i] = rows[REST, i] + rows[LINK, i] + touch[i], rows[MOTOR, i] + rows[FRICTION, i]
    if not seen.first:
        step(drives, M, L, rest, f, sent[delay], dt, rows)
        _correct(numbers, drives, M, seen, rows)
    for i in range(n):
        y = min(max(seen.qdot_ref[i] / numbers[BAND], -1.0), 1.0)
        rows[DRY, i] = max(rows[DRY, i] + numbers[LEARNING] * dt * rows[MOTOR, i] * y, 0.0)
        rows[FRICTION, i] = rows[DRY, i] * y
        rest[i], f[i] = rows[REST, i] + rows[LINK, i] + touch[i], rows[MOTOR, i] + rows[FRICTION, i]
        d[i] = rows[LINK, i] + touch[i] - f[i]
        for k in range(4):
            x[k, i] = rows[k, i]
    for k in range(delay - 1, -1, -1):
        step(drives, M, L, rest, f, sent[k], dt, x)
    model = seen.elsewhere
    kinematics(model, x[Q])
    dynamics(model, x[V])
    _take_model(drives, model.M, model.bias, dt, rows, M)
    return GOES_ON


@compiled
def last_sent(memory: Array, n: int) -> Array:
    """The command of the last tick (n,) [N m], where the observer keeps it."""
    return memory[(ROWS + n) * n : (ROWS + n + 1) * n]


@compiled
def send(numbers: Array, seen: Seen, memory: Array, out: Array, limits: int) -> None:
    """Keep the sum of the terms within the torques, and their rate, that the arm takes; remember it.

    What is cut off is added to the row `limits` of `out`.
    """
    n, delay = seen.q.size, int(numbers[DELAY])
    sent, most = memory[(ROWS + n) * n :].reshape((delay + 1, n)), numbers[RATE] * seen.dt_s
    for k in range(delay, 0, -1):
        for i in range(n):
            sent[k, i] = sent[k - 1, i]
    for i in range(n):
        wanted = 0.0
        for k in range(out.shape[0]):
            wanted += out[k, i]
        inside = min(max(wanted, -seen.tau_max[i]), seen.tau_max[i])
        inside = min(max(inside, sent[0, i] - most), sent[0, i] + most)
        out[limits, i] += inside - wanted
        sent[0, i] = inside


@compiled
def _begin(drives: Array, seen: Seen, touch: Array, rows: Array, M: Array, sent: Array) -> None:
    """The arm is at rest: what its gears bear beyond the nominal weight is a disturbance of the links."""
    for i in range(seen.q.size):
        rows[Q, i], rows[S, i] = seen.q[i], seen.tau[i] / drives[STIFFNESS, i]
        rows[LINK, i] = seen.bias[i] - seen.tau[i] - touch[i]
        for k in range(sent.shape[0]):
            sent[k, i] = seen.tau[i]
    _take_model(drives, seen.M, seen.bias, seen.dt_s, rows, M)


@compiled
def _take_model(drives: Array, whole: Array, bias: Array, dt: float, rows: Array, M: Array) -> None:
    """Keep -c and the links' own inertia for the next step."""
    for i in range(bias.size):
        rows[REST, i] = -bias[i]
        for j in range(bias.size):
            M[i, j] = whole[i, j]
        M[i, i] = max(M[i, i] - drives[ARMATURE, i], drives[STIFFNESS, i] * dt * dt)


@compiled
def factor_step(drives: Array, M: Array, dt: float, L: Array) -> bool:
    """L (n, n) = the Cholesky factor of a step's equation for v+; M (n, n) is the links' inertia.

    Args:
        drives: K, B_s, D_s, D_l (4 or more, n).
        M: Inertia of the links (n, n) [kg m^2].
        dt: T [s].
        L: Filled.
    """
    n = M.shape[0]
    for i in range(n):
        for j in range(n):
            L[i, j] = M[i, j] / dt
        beta, kappa = drives[APPARENT, i] / dt, 0.25 * drives[STIFFNESS, i] * dt
        mu = kappa + 0.5 * drives[LOOP, i]
        L[i, i] += 0.5 * drives[DAMPING, i] + kappa * beta / (beta + mu)
    return factor(L)


@compiled
def step(drives: Array, M: Array, L: Array, rest: Array, f: Array, u: Array, dt: float, x: Array) -> None:
    """Move the state over a period in which the torques u (n,) act.

    Args:
        drives: K, B_s, D_s, D_l (4 or more, n).
        M: Inertia of the links (n, n) [kg m^2].
        L: Of `factor_step`.
        rest: d - c (n,) [N m].
        f: On the motors (n,) [N m].
        u: Commanded torques that act (n,) [N m].
        dt: T [s].
        x: State in its first rows q, v, s, w (4 or more, n), changed.
    """
    n = rest.size
    push, v = scratch(n), scratch(n)
    times(M, x[V], v)
    for i in range(n):
        K, slip = drives[STIFFNESS, i], x[W, i] - x[V, i]
        beta, kappa = drives[APPARENT, i] / dt, 0.25 * K * dt
        mu = kappa + 0.5 * drives[LOOP, i]
        push[i] = beta * x[W, i] + u[i] - f[i] - K * x[S, i] - mu * slip
        v[i] = v[i] / dt + rest[i] - 0.5 * drives[DAMPING, i] * x[V, i]
        v[i] += K * x[S, i] + kappa * slip + kappa * push[i] / (beta + mu)
    back_substitute(L, v)
    for i in range(n):
        beta, kappa = drives[APPARENT, i] / dt, 0.25 * drives[STIFFNESS, i] * dt
        mu = kappa + 0.5 * drives[LOOP, i]
        w = (push[i] + mu * v[i]) / (beta + mu)
        x[Q, i] += 0.5 * dt * (x[V, i] + v[i])
        x[S, i] += 0.5 * dt * (x[W, i] + w - x[V, i] - v[i])
        x[V, i], x[W, i] = v[i], w


@compiled
def _correct(numbers: Array, drives: Array, M: Array, seen: Seen, rows: Array) -> None:
    """Correct state and disturbances by what is measured."""
    n, dt = seen.q.size, seen.dt_s
    a, b, g = filter_gains(numbers[LINK_STATE], numbers[LINK_CUTOFF], dt)
    a_m, b_m, g_m = filter_gains(numbers[MOTOR_STATE], numbers[MOTOR_CUTOFF], dt)
    e, moved = scratch(n), scratch(n)
    for i in range(n):
        e[i] = seen.q[i] - rows[Q, i]
    times(M, e, moved)
    for i in range(n):
        short = seen.tau[i] / drives[STIFFNESS, i] - rows[S, i]
        whole = e[i] + short
        rows[Q, i] += a * e[i]
        rows[V, i] += b * e[i] / dt
        rows[S, i] += a_m * short
        rows[W, i] += b_m * whole / dt
        rows[MOTOR, i] -= g_m * drives[APPARENT, i] * whole / (dt * dt)
        rows[LINK, i] += g * moved[i] / (dt * dt)
