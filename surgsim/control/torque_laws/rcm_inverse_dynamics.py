"""RCM inverse dynamics: ours. RCM over tip over posture at acceleration level, disturbances rejected."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.observer import (
    delay_size,
    estimate_delay,
    observe,
    observer_size,
    remember_command,
    torque_offset,
)
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.control.torque_laws.rcm_hierarchy import HIERARCHY_GAINS, TERMS, fill_terms, fill_touch
from surgsim.control.torque_laws.rcm_tasks import RcmTasksConfig
from surgsim.models.arm import ArmModel
from surgsim.tick.algebra import back_substitute, factor
from surgsim.tick.arrays import Seen
from surgsim.tick.nominal import copy_model, dynamics, kinematics
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, INFEASIBLE, RANK_LOST

OBSERVER, MOST_DELAY, FULL_GAIN, MOTORS = range(HIERARCHY_GAINS, HIERARCHY_GAINS + 4)
"""Places of the gains that are this law's own; from MOTORS on the inertias of real drives' motors (n,)."""


class RcmInverseDynamicsConfig(RcmTasksConfig):
    """Inverse dynamics of RCM, tip and posture in strict priority, with a disturbance observer.

    Attributes:
        observer_gain: Share of a period's unexplained velocity change that the disturbance observer takes
            in; 0 switches it off.
        most_delay_ticks: Longest actuation delay that is recognised and predicted over; 0 switches the
            prediction off.
        full_gain_delay_s: Longest recognised delay at which all gains are whole; past it bandwidths fall as
            its inverse [s].
        sensor_delay_s: Part of the recognised delay that is known to be the sensors': the command, which is
            of now, is not carried over it [s].
        contact: What becomes of the measured force on the tip: `reject` lets the observer cancel it like
            any disturbance; `yield` cancels it too, but for the tip's acceleration along it, so that the tip
            is an impedance towards what it touches.
        energy_valve: Whether the command's energy budget covers the tip's kinetic energy at all times, see
            `surgsim.control.tip_energy.throttle`; needs `yield`, and does nothing without a budget.
        press_max_n: Largest force with which the tip is driven against what it touches; needs `yield`; null:
            as far as the torques reach [N].
    """

    type: Literal["rcm_inverse_dynamics"] = "rcm_inverse_dynamics"
    observer_gain: Annotated[float, Field(ge=0.0, le=1.0)] = 0.3
    most_delay_ticks: Annotated[int, Field(ge=0, le=1000)] = 20
    full_gain_delay_s: PositiveFloat = 0.01
    sensor_delay_s: NonNegativeFloat = 0.0
    contact: Literal["reject", "yield"] = "reject"
    energy_valve: bool = False
    press_max_n: PositiveFloat | None = None

    @model_validator(mode="after")
    def _knows_the_drive(self) -> Self:
        for key in ("energy_valve", "press_max_n"):
            if getattr(self, key) and self.contact != "yield":
                raise ValueError(f"{key} needs contact: yield, or the observer drives the tip past it")
        return self

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law; memory of the disturbance observer, then of the delay estimate."""
        n = arm.limits.torque.size
        return KernelTorqueLaw(
            kernel=rcm_inverse_dynamics,
            arm=arm,
            terms=TERMS,
            gains=np.array(
                [
                    *self.task_gains(
                        self.sensor_delay_s,
                        self.contact == "yield",
                        self.energy_valve,
                        self.press_max_n or 0.0,
                    ),
                    self.observer_gain,
                    self.most_delay_ticks,
                    self.full_gain_delay_s,
                    *(np.zeros(n) if arm.drive is None else arm.drive.apparent_inertia),
                ],
                dtype=np.float64,
            ),
            memory_size=observer_size(n) + delay_size(n, self.most_delay_ticks),
            failures={INFEASIBLE: "no joint acceleration keeps all limits"},
        )


@compiled
def rcm_inverse_dynamics(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Tau = M q'' + bias + D q' - d, at the state predicted for when the torque will act.

    The accelerations ask for second-order error dynamics,

        J_rcm q'' = N C'' - b_rcm - k_r e - 2 z_r sqrt(k_r) e'
        J_T q''   = a_d - J_T' q' + 2 z_t sqrt(k_t) (v_d - v) + k_t (p_d - p)
        q''       = k_q (q_ref - q) + 2 z_q sqrt(k_q) (q_ref' - q')        in the null space of both

    solved in closed form with the inertia-weighted inverse: where [J_T; J_rcm] has full rank, no row has to
    give way. If that answer would pass a torque limit, or a velocity from which a joint cannot stop before
    its limit, a cascade of quadratic programs keeps the limits and lets the posture give way first, then the
    tip, and the RCM last (`surgsim.control.acceleration.prioritised`).

    d is the disturbance torque that `surgsim.control.observer.observe` infers from measured torque and
    motion: payload, friction, wrong inertia, pushes. It is fed by the measured torque, so that saturation and
    late torques do not wind it up, less the slow mean by which measured and commanded torque differ: a biased
    drive or sensor. With `contact: yield` the measured force f on the tip is not left to the observer. It is
    cancelled at once, and the tip is asked for the acceleration along f that it would take under it with the
    shaft held in the trocar,

        a_T += f (f' P f) / (f' f),    P the tip's mobility with the RCM held (3, 3) [1/kg],

    so that RCM, posture and the tip across f do not give way.

    An actuation delay shows as the lag of measured behind commanded torque (`estimate_delay`); the law then
    acts on the state predicted with the torques still on their way, which is why stiff gains survive it. Past
    `full_gain_delay_s` the prediction is no longer good enough: bandwidths and observer gain fall as its
    inverse.

    Rows tip, rcm, joint, bias, observer, limits (6, n) [N m].

    Source: ours; the hierarchy is operational-space control (Khatib 1987), the observer the discrete form of
    a momentum observer (De Luca et al. 2006), the prediction one of the state over the dead time.
    """
    n, most = seen.q.size, int(gains[MOST_DELAY])
    touch, tau, d = scratch(n), scratch(n), scratch(n)
    fill_touch(gains, seen, touch)
    late = foresee(gains[HIERARCHY_GAINS:], seen, memory, touch, d)
    if late < 0.0:
        return RANK_LOST
    share = whole_share(gains[HIERARCHY_GAINS:], late)
    status = fill_terms(gains, seen, seen.elsewhere, late, d, share, out)
    if status != GOES_ON:
        return status
    for i in range(n):
        s = 0.0
        for k in range(out.shape[0]):
            s += out[k, i]
        tau[i] = min(max(s, -seen.tau_max[i]), seen.tau_max[i])
    remember_command(memory[n * (n + 3) :], most, tau)
    return GOES_ON


@compiled
def whole_share(numbers: Array, late: float) -> float:
    """The share of all bandwidths that is used `late` [s] ahead; numbers as of `foresee`."""
    share: float = min(1.0, numbers[FULL_GAIN - HIERARCHY_GAINS] / late) if late > 0.0 else 1.0
    return share


@compiled
def foresee(numbers: Array, seen: Seen, memory: Array, touch: Array, d: Array) -> float:
    """Evaluate `seen.elsewhere` where the arm will be when the next command acts; by how much later [s].

    Args:
        numbers: The law's own gains: observer, longest delay, full gain, motors (3 + n,).
        seen: What is measured.
        memory: Of the observer, then of the delay estimate, which `remember_command` tells of every command.
        touch: Measured torque of the surroundings, which the observer need not find (n,) [N m].
        d: Filled with the disturbance torque, `touch` in it (n,) [N m].

    Returns:
        The delay [s], or -1 if the inertia is none.
    """
    n, dt, first, most = seen.q.size, seen.dt_s, seen.first != 0, int(numbers[MOST_DELAY - HIERARCHY_GAINS])
    known, delayed = memory[: n * (n + 3)], memory[n * (n + 3) :]
    ticks = estimate_delay(delayed, first, seen.tau, most, dt)
    late = ticks * dt
    tau, offset = scratch(n), torque_offset(delayed, most, n)
    for i in range(n):
        tau[i] = seen.tau[i] - (offset[i] - touch[i])
    links = scratch_matrix(n, n)
    links[:] = seen.M
    for i in range(n):  # what is measured on real drives acts behind their motors
        links[i, i] -= numbers[MOTORS - HIERARCHY_GAINS + i]
    gain = whole_share(numbers, late) * numbers[OBSERVER - HIERARCHY_GAINS]
    learnt = observe(known, first, links, seen.bias, seen.damping, seen.v, tau, gain, dt)
    for i in range(n):
        d[i] = learnt[i] + touch[i]
    model = seen.elsewhere
    if ticks == 0:
        copy_model(seen, model)
        return late
    q, v = scratch(n), scratch(n)
    q[:], v[:] = seen.q, seen.v
    if not predict(q, v, seen.M, seen.bias, d, seen.damping, delayed, ticks, dt):
        return -1.0
    kinematics(model, q)
    dynamics(model, v)
    return late


@compiled
def predict(
    q: Array,
    v: Array,
    M: Array,
    bias: Array,
    d: Array,
    damping: Array,
    commands: Array,
    ticks: int,
    dt: float,
) -> bool:
    """Move (q, v), each (n,), by the last `ticks` torques in `commands`, newest first; False without inertia.

    Semi-implicit Euler with the inertia and bias of the present state, which change little over a few
    milliseconds.
    """
    n = q.size
    L, rate = scratch_matrix(n, n), scratch(n)
    L[:] = M
    for i in range(n):
        L[i, i] += dt * damping[i]
    if not factor(L):
        return False
    for k in range(ticks - 1, -1, -1):
        for i in range(n):
            rate[i] = commands[k * n + i] - (bias[i] - d[i]) - damping[i] * v[i]
        back_substitute(L, rate)
        for i in range(n):
            v[i] += dt * rate[i]
            q[i] += dt * v[i]
    return True
