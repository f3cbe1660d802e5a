"""An arm's own joint impedance, and what its interface makes of the joint positions that it is commanded.

A command is where the joints are to be at the end of a control period. The reference moves there linearly:

    q_d(s) = q_d,k-1 + s (q_d,k - q_d,k-1),  0 <= s <= 1
    v_k = (q_d,k - q_d,k-1) / h,  a_k = (v_k - v_k-1) / h,  j_k = (a_k - a_k-1) / h

with the control period h. Of a command that does not arrive the interface assumes constant acceleration,
a_k = a_k-1. The loop is

    u = K_j (q_d - q) - D_j theta' + tau_ff + c(q, q')
    q = theta - tau_J / K,    D_j = 2 zeta sqrt(K_j M_jj(q))

inside the torque limits, with inertia M and bias c of the arm's own model, evaluated once a physics step.
Position and speed are the motor's, the position less the deflection of the gear K by the measured torque
tau_J: damping of the link's speed through the gear would make a stiff loop unstable.

Source: the Fast Research Interface's `doJntImpedanceControl` for what is commanded, with the damping as a
ratio; its maker does not say of which inertia. For the motor's side: Albu-Schaeffer, Ott, Hirzinger, Int. J.
Robotics Research 26:23 (2007). For limits and lost commands: the documentation of the control interface FCI,
"Robot and interface specifications" and "libfranka: Under the hood".
"""

import math

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.mujoco_calls import mj_comPos, mj_comVel, mj_fullM, mj_kinematics, mj_makeM, mj_rne
from surgsim.tick.scratch import scratch_matrix
from surgsim.tick.status import GOES_ON, JOINT_ACCELERATION, JOINT_JERK
from surgsim.tick.views import vector

CLIP, STOP, IGNORE = range(3)
"""What becomes of a command past a limit."""
_ROUNDING = 1e-9


@compiled
def begin_at(q_cmd: Array, begin: Array, target: Array, speed: Array, acceleration: Array) -> None:
    """The reference rests at the first command."""
    for i in range(q_cmd.size):
        begin[i] = target[i] = q_cmd[i]
        speed[i] = acceleration[i] = 0.0


@compiled
def follow(
    past: int,
    h: float,
    fastest: Array,
    jerkiest: Array,
    q_cmd: Array,
    begin: Array,
    target: Array,
    speed: Array,
    acceleration: Array,
) -> int:
    """Move the reference's target to a command, as far as the limits let it; the status of a reflex.

    With `CLIP` jerk, then acceleration are cut, and the velocity follows: libfranka's `limitRate`, without
    its margin towards the velocity limit.

    Args:
        past: What becomes of a command past a limit.
        h: Control period [s].
        fastest: Largest accelerations (n,) [rad/s^2].
        jerkiest: Largest jerks (n,) [rad/s^3].
        q_cmd: The command (n,) [rad]; infinite: none arrived.
        begin: Where the reference begins the period (n,) [rad], filled.
        target: Where it ends it (n,) [rad], changed.
        speed: v_k (n,) [rad/s], changed.
        acceleration: a_k (n,) [rad/s^2], changed.
    """
    arrived, status = not math.isinf(q_cmd[0]), GOES_ON
    for i in range(target.size):
        begin[i] = target[i]
        a, whole = acceleration[i], False
        if arrived:
            asked = ((q_cmd[i] - begin[i]) / h - speed[i]) / h
            jerk = (asked - a) / h
            if past == CLIP:
                a += h * min(max(jerk, -jerkiest[i]), jerkiest[i])
                a = min(max(a, -fastest[i]), fastest[i])
                whole = abs(asked) <= fastest[i] and abs(jerk) <= jerkiest[i]
            else:
                whole = True
                if past == STOP and abs(asked) > fastest[i] * (1.0 + _ROUNDING):
                    status = JOINT_ACCELERATION
                elif past == STOP and status == GOES_ON and abs(jerk) > jerkiest[i] * (1.0 + _ROUNDING):
                    status = JOINT_JERK
            if whole:
                a = asked
        speed[i] += h * a
        acceleration[i] = a
        target[i] = q_cmd[i] if whole else begin[i] + h * speed[i]
    return status


@compiled
def evaluate(
    mj_model: int,
    mj_data: int,
    qpos: int,
    qvel: int,
    q: Array,
    v: Array,
    stiffness: Array,
    ratio: Array,
    damping: Array,
    bias: Array,
) -> None:
    """Damping and bias of the loop by the arm's own model.

    Args:
        mj_model: Address of that model.
        mj_data: Of its data.
        qpos: Of the positions in them.
        qvel: Of the velocities.
        q: Joint positions (n,) [rad].
        v: Joint velocities (n,) [rad/s].
        stiffness: K_j (n,) [N m/rad].
        ratio: zeta (n,).
        damping: D_j (n,) [N m s/rad], filled.
        bias: c (n,) [N m], filled.
    """
    n = q.size
    at, moving, M = vector(qpos, n), vector(qvel, n), scratch_matrix(n, n)
    for i in range(n):
        at[i], moving[i] = q[i], v[i]
    mj_kinematics(mj_model, mj_data)
    mj_comPos(mj_model, mj_data)
    mj_comVel(mj_model, mj_data)
    mj_rne(mj_model, mj_data, 0, bias.ctypes.data)
    mj_makeM(mj_model, mj_data)
    mj_fullM(mj_model, mj_data, M.ctypes.data)
    for i in range(n):
        damping[i] = 2.0 * ratio[i] * math.sqrt(stiffness[i] * M[i, i])
