"""The drives of the joints as the plant has them: motors behind elastic gears, with their torque loops.

MuJoCo moves the links; their joints have no armature, and are driven by the torques of the gears. Over a
physics step the arm's inertia, and all forces on it but those, are taken as they are at its beginning; motors
and links are then integrated together, in substeps of the torque loop's own period and by the trapezoidal
rule. What the gears, less the links' damping, gave on average over the step is handed to MuJoCo, which steps
the links; they end where both integrations say:

    v+ = v + h M^-1 (mean tau_J + other forces),    q+ = q + h v+ + (x - q - h v_x)

with x, v_x the links' motion by the substeps, and M^-1 as MuJoCo's integrator has it. The gears may thus be
as stiff, and the links as light, as they are: nothing of it limits the physics step.

    beta = B / h_s,  kappa = K h_s / 4 + D / 2                           of each joint, h_s the substep
    tau_J = K s + kappa (w + w+ - v - v+),  s+ = s + h_s (w + w+ - v - v+) / 2
    beta (w+ - w) = tau_m - tau_J - tau_f
    M (v+ - v) / h_s = r + tau_J - D_l (v + v+) / 2

are solved for v+ with one Cholesky factor a step. Dry friction holds a motor that it can hold: tau_f is what
brings w+ to rest, or, where that is more than the friction is, the friction against the motion. So it is
with the links' own dry friction, which is MuJoCo's no longer: a light link on a stiff gear would be thrown
about by a friction that is found once a physics step (`surgsim.plant.dry_friction`).

The joints b of a shaft that bends are moved as MuJoCo moves them, by the forces r_b on them and with their
damping D_b in A = M_bb + h D_b. For the arm's joints a, M and r are then M_aa - M_ab A^-1 M_ba and
r_a - M_ab A^-1 r_b.

Where the arm is commanded joint positions, its own impedance loop gives the torque loop its torque, once a
substep (`surgsim.plant.impedance`). What is commanded besides is then added.

Drives: `surgsim.models.drive`.
"""

import math
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.columns import joints, scalar
from surgsim.compiled import compiled
from surgsim.models.build import Scene, build_arm
from surgsim.models.config import SceneConfig
from surgsim.models.drive import DriveConfig
from surgsim.models.robot import joint_names, motor_names
from surgsim.plant.disturbances.base import copied, spread_factor
from surgsim.plant.dry_friction import rub
from surgsim.plant.impedance import CLIP, IGNORE, STOP, begin_at, evaluate, follow
from surgsim.plant.part import PlantPart
from surgsim.plant.shaft import bend_joints
from surgsim.tick.algebra import back_substitute, back_substitute_rows, factor, times
from surgsim.tick.arrays import Record, World
from surgsim.tick.mujoco_calls import mj_fullM
from surgsim.tick.overlay import laid_over, overlay
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, RANK_LOST, TORQUE_RATE
from surgsim.tick.views import vector

LOOP_S = 1e-4
"""Period of the torque loop, and longest substep [s]."""
LAST = 10
"""Rank in the chain of `actuate`: what arrives at the drives."""
_BEFORE_ALL = -1
_PAST = {"clip": CLIP, "stop": STOP, "ignore": IGNORE}


class Law(Record):
    """Numbers of the drives; after it in the gains the rows of `STIFFNESS` and so on (n,).

    Attributes:
        passive: Address of `qfrc_passive`; as the following four of MuJoCo's arrays.
        smooth: Of `qfrc_smooth`.
        actuator: Of `qfrc_actuator`.
        constraint: Of `qfrc_constraint`.
        substeps: Of a physics step.
        delay: Of the torque loop, in substeps.
        past_rate: What becomes of a torque that changes too fast.
        at_motor: Whether joints are measured on the motor's side.
        bends: Joints of a shaft that bends, which follow the arm's.
        rubs: Whether links have dry friction.
        damping: Address of the damping of all joints.
        impedes: Whether the arm's own impedance loop may be commanded.
        past_motion: What becomes of a joint motion past its limits.
        mj_model: Address of the arm's own model; as the next three, 0 where it does not impede.
        mj_data: Of its data.
        qpos: Of the positions in them.
        qvel: Of the velocities.
        h: Physics step [s].
        ratio: B / B_s.
        keep: Share of the motor's torque that is kept over a substep, exp(-2 pi f h_s).
        observes: Share of the unexplained torque that the friction observer takes in a substep.
        stribeck: Stribeck velocity [rad/s].
        waves: Ripple's periods a radian [1/rad].
        rate: Fastest change of the command in a tick [N m].
        command_keep: Share of the command that the interface's low-pass keeps over a tick.
    """

    passive: int
    smooth: int
    actuator: int
    constraint: int
    substeps: int
    delay: int
    past_rate: int
    at_motor: int
    bends: int
    rubs: int
    damping: int
    impedes: int
    past_motion: int
    mj_model: int
    mj_data: int
    qpos: int
    qvel: int
    h: float
    ratio: float
    keep: float
    observes: float
    stribeck: float
    waves: float
    rate: float
    command_keep: float


class Account(Record):
    """Beginning of the memory: energies since the start [J], and what was told; after it the rows (n,).

    Attributes:
        told: Whether a reflex was told.
        refers: Whether the arm's own impedance loop acts.
        passed: Substeps since the command.
        work: Of the motors' torques.
        loss: In friction, ripple and gears.
        given: To the links.
        rubbed: Of that, lost in their dry friction.
        stored_at_start: In gears and rotors.
    """

    told: int
    refers: int
    passed: int
    work: float
    loss: float
    given: float
    rubbed: float
    stored_at_start: float


LAW, LAW_SIZE = overlay(Law)
ACCOUNT, ACCOUNT_SIZE = overlay(Account)
STIFFNESS, GEAR, ROTOR, LOOP, COULOMB, STATIC, VISCOUS, RIPPLE = range(8)
BIAS, WAVE, LINK_DAMPING, LINK_DRY = range(8, 12)
IMPEDANCE, RATIO, FASTEST, JERKIEST, LIMIT = range(12, 17)
"""Rows of the gains: K, D, B, D_s, friction, ripple, the torque sensor's bias and ripple; of the links; of
the arm's own impedance K_j and zeta, limits of commanded acceleration and jerk, limits of the torque."""
THETA, OMEGA, MOTOR, COMMAND, OTHERS, FRICTION, MOVED, TAKEN, RUBBED = range(9)
BEGIN, TARGET, SPEED, ACCELERATION, HOLDING, MODEL, IMPEDED = range(9, 16)
"""Rows of the memory: motor's position and speed, its torque, the command that acts, other forces on the
links, friction as observed, the links' correction of a step, friction and ripple as they are, dry friction of
the links; of the arm's own loop the reference's begin and end in this period, its speed and acceleration,
D_j, the bias, and the torque that it gives."""
_ROWS = 16
"""After them the inertia of all joints (nv, nv), the other forces on those of a shaft that bends, and the
sensed torques and gear speeds of the last substeps (delay + 1, 2, n)."""


@compiled
def _row(array: Array, begin: int, row: int, n: int) -> Array:
    return array[begin + row * n : begin + (row + 1) * n]


@compiled
def receive(gains: Array, world: World, memory: Array, out: Array) -> int:
    """What the interface makes of the command: its low-pass, then its limit of the torque's rate.

    The first command is where both begin. Once the reflex has told, the stop that follows is clipped.
    """
    law, account, n = gains[:LAW_SIZE].view(LAW)[0], memory[:ACCOUNT_SIZE].view(ACCOUNT)[0], world.q.size
    acting = _row(memory, ACCOUNT_SIZE, COMMAND, n)
    status, begins = GOES_ON, world.tick == 0
    if law.impedes:
        begins = begins or (account.refers == 0 and not math.isnan(world.q_cmd[0]))
        status = _take_reference(gains, law, account, world, memory)
    for i in range(n):
        wanted = law.command_keep * acting[i] + (1.0 - law.command_keep) * world.torque[i]
        if begins:
            wanted = world.torque[i]
        elif law.past_rate == CLIP or account.told:
            wanted = min(max(wanted, acting[i] - law.rate), acting[i] + law.rate)
        elif law.past_rate == STOP and abs(wanted - acting[i]) > law.rate * (1.0 + 1e-9):
            status = TORQUE_RATE
        acting[i] = world.torque[i] = wanted
    if status != GOES_ON:
        account.told = 1
    return status


@compiled
def _take_reference(gains: Array, law: Law, account: Account, world: World, memory: Array) -> int:
    """Whether the arm's own loop acts in this period, and where its reference goes; the status of a reflex.

    From the loop's last torque on a commanded torque takes over.
    """
    n, referred = world.q.size, not math.isnan(world.q_cmd[0])
    begin, target = _row(memory, ACCOUNT_SIZE, BEGIN, n), _row(memory, ACCOUNT_SIZE, TARGET, n)
    speed, acceleration = _row(memory, ACCOUNT_SIZE, SPEED, n), _row(memory, ACCOUNT_SIZE, ACCELERATION, n)
    status = GOES_ON
    if account.refers and not referred:
        acting, last = _row(memory, ACCOUNT_SIZE, COMMAND, n), _row(memory, ACCOUNT_SIZE, IMPEDED, n)
        acting[:] = last
    elif referred and (world.tick == 0 or not account.refers):
        begin_at(world.q_cmd, begin, target, speed, acceleration)
    elif referred:
        fastest = _row(gains, LAW_SIZE, FASTEST, n)
        jerkiest = _row(gains, LAW_SIZE, JERKIEST, n)
        status = follow(
            CLIP if account.told else law.past_motion,
            world.dt_s,
            fastest,
            jerkiest,
            world.q_cmd,
            begin,
            target,
            speed,
            acceleration,
        )
    account.refers, account.passed = 1 if referred else 0, 0
    return status


@compiled
def _impede(
    gains: Array, law: Law, account: Account, memory: Array, x: Array, v: Array, periods: int
) -> None:
    """The arm's own loop: the torque that it gives its torque loop (n,) [N m], from now on for a substep.

    It knows the joints from motors and torque sensors, wherever the encoders are that a controller has.
    """
    n = x.size
    K, stiffness = _row(gains, LAW_SIZE, STIFFNESS, n), _row(gains, LAW_SIZE, IMPEDANCE, n)
    limit, command = _row(gains, LAW_SIZE, LIMIT, n), _row(memory, ACCOUNT_SIZE, COMMAND, n)
    theta, omega = _row(memory, ACCOUNT_SIZE, THETA, n), _row(memory, ACCOUNT_SIZE, OMEGA, n)
    begin, target = _row(memory, ACCOUNT_SIZE, BEGIN, n), _row(memory, ACCOUNT_SIZE, TARGET, n)
    damping, bias = _row(memory, ACCOUNT_SIZE, HOLDING, n), _row(memory, ACCOUNT_SIZE, MODEL, n)
    given = _row(memory, ACCOUNT_SIZE, IMPEDED, n)
    share = (account.passed + 0.5) / (law.substeps * periods)
    account.passed += 1
    for i in range(n):
        q = theta[i] - _felt(gains, law, n, i, theta[i], x[i], omega[i] - v[i]) / K[i]
        u = stiffness[i] * (begin[i] + share * (target[i] - begin[i]) - q) - damping[i] * omega[i]
        given[i] = min(max(u + command[i] + bias[i], -limit[i]), limit[i])


@compiled
def move(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Integrate motors and links over a physics step; MuJoCo's motors are given the gears' mean torques."""
    law, n, nv, first = gains[:LAW_SIZE].view(LAW)[0], world.q.size, world.nv, world.first_dof
    tail = ACCOUNT_SIZE + _ROWS * n
    whole = memory[tail : tail + nv * nv].reshape(nv, nv)
    mj_fullM(world.mj_model, world.mj_data, whole.ctypes.data)
    K, D = _row(gains, LAW_SIZE, STIFFNESS, n), _row(gains, LAW_SIZE, GEAR, n)
    B, damping = _row(gains, LAW_SIZE, ROTOR, n), _row(gains, LAW_SIZE, LINK_DAMPING, n)
    others, moved = _row(memory, ACCOUNT_SIZE, OTHERS, n), _row(memory, ACCOUNT_SIZE, MOVED, n)
    qpos, qvel = vector(world.qpos, world.nq), vector(world.qvel, nv)
    bias, passive = vector(world.qfrc_bias, nv), vector(law.passive, nv)
    x, v, rest, mean, gain = scratch(n), scratch(n), scratch(n), scratch(n), scratch(n)
    push, momentum, inverse = scratch(n), scratch(n), scratch_matrix(n, n)
    S, hs = scratch_matrix(n, n), law.h / law.substeps
    ring = memory[tail + nv * nv + law.bends :]
    sensed = ring[:n]
    for i in range(n):
        x[i], v[i] = qpos[world.first_qpos + i], qvel[first + i]
        rest[i] = passive[first + i] - bias[first + i] + others[i]
        mean[i] = gain[i] = momentum[i] = 0.0
    account = memory[:ACCOUNT_SIZE].view(ACCOUNT)[0]
    if account.refers:
        stiffness, ratio = _row(gains, LAW_SIZE, IMPEDANCE, n), _row(gains, LAW_SIZE, RATIO, n)
        holding, bias = _row(memory, ACCOUNT_SIZE, HOLDING, n), _row(memory, ACCOUNT_SIZE, MODEL, n)
        evaluate(law.mj_model, law.mj_data, law.qpos, law.qvel, x, v, stiffness, ratio, holding, bias)
    if law.bends > 0 and not _take_out_shaft(
        law, world, whole, memory[tail + nv * nv : tail + nv * nv + law.bends], rest
    ):
        return RANK_LOST
    for i in range(n):
        for j in range(n):
            S[i, j] = whole[first + i, first + j] / hs
            inverse[i, j] = 1.0 if i == j else 0.0
            momentum[i] += S[i, j] * qvel[first + j]
        beta, kappa = B[i] / hs, 0.25 * K[i] * hs + 0.5 * D[i]
        S[i, i] += 0.5 * damping[i] + kappa * beta / (beta + kappa)
    if not factor(S):
        return RANK_LOST
    back_substitute_rows(S, inverse)
    for _ in range(law.substeps):
        if account.refers:
            _impede(gains, law, account, memory, x, v, world.substeps)
        _close_loop(gains, law, memory, ring, x, v)
        _push_motors(gains, law, memory, x, v, gain, push)
        _substep(gains, law, memory, inverse, momentum, rest, push, sensed, x, v, gain, mean)
    ctrl = vector(world.ctrl, world.first_ctrl + n)
    for i in range(n):
        ctrl[world.first_ctrl + i] = mean[i] / law.substeps
        moved[i] = x[i] - qpos[world.first_qpos + i] - law.h * v[i]
    return GOES_ON


@compiled
def _take_out_shaft(law: Law, world: World, whole: Array, others: Array, rest: Array) -> bool:
    """What the arm's joints feel of a shaft whose joints follow theirs; False where that has no inertia.

    Args:
        law: Of the drives.
        world: The plant's.
        whole: Inertia of all joints (nv, nv); the arm's part is changed.
        others: Other forces on the shaft's joints (bends,) [N m].
        rest: Other forces on the links (n,) [N m], changed.
    """
    n, b, begin = world.q.size, law.bends, world.first_dof + world.q.size
    damping, passive = vector(law.damping, world.nv), vector(law.passive, world.nv)
    bias, A, column = vector(world.qfrc_bias, world.nv), scratch_matrix(b, b), scratch(b)
    for i in range(b):
        for j in range(b):
            A[i, j] = whole[begin + i, begin + j]
        A[i, i] += law.h * damping[begin + i]
    if not factor(A):
        return False
    for i in range(b):
        column[i] = passive[begin + i] - bias[begin + i] + others[i]
    back_substitute(A, column)
    for i in range(n):
        for k in range(b):
            rest[i] -= whole[world.first_dof + i, begin + k] * column[k]
    for j in range(n):
        for k in range(b):
            column[k] = whole[begin + k, world.first_dof + j]
        back_substitute(A, column)
        for i in range(n):
            for k in range(b):
                whole[world.first_dof + i, world.first_dof + j] -= (
                    whole[world.first_dof + i, begin + k] * column[k]
                )
    return True


@compiled
def _push_motors(gains: Array, law: Law, memory: Array, x: Array, v: Array, gain: Array, push: Array) -> None:
    """Fill `push` (n,), what w+ is but for kappa v+, times beta + kappa; book what friction takes."""
    n, hs = x.size, law.h / law.substeps
    K, D = _row(gains, LAW_SIZE, STIFFNESS, n), _row(gains, LAW_SIZE, GEAR, n)
    B, taken = _row(gains, LAW_SIZE, ROTOR, n), _row(memory, ACCOUNT_SIZE, TAKEN, n)
    theta, omega = _row(memory, ACCOUNT_SIZE, THETA, n), _row(memory, ACCOUNT_SIZE, OMEGA, n)
    motor = _row(memory, ACCOUNT_SIZE, MOTOR, n)
    for i in range(n):
        beta, kappa = B[i] / hs, 0.25 * K[i] * hs + 0.5 * D[i]
        free = beta * omega[i] + motor[i] - K[i] * (theta[i] - x[i]) - kappa * (omega[i] - v[i])
        # a motor that stands is held against what would move it, the link going on as in the last substep
        taken[i] = _friction(gains, law, n, i, theta[i], omega[i], free + kappa * (v[i] + gain[i]))
        push[i] = free - taken[i]


@compiled
def _substep(
    gains: Array,
    law: Law,
    memory: Array,
    inverse: Array,
    momentum: Array,
    rest: Array,
    push: Array,
    sensed: Array,
    x: Array,
    v: Array,
    gain: Array,
    mean: Array,
) -> None:
    """One substep of motors and links.

    Args:
        gains: Numbers of the drives.
        law: Their beginning.
        memory: Of the drives, changed.
        inverse: Of the equation for v+ (n, n).
        momentum: M v / h_s (n,) [N m], changed.
        rest: Other forces on the links (n,) [N m].
        push: Of `_push_motors` (n,) [N m].
        sensed: Torques of the gears as they were last sensed (n,) [N m].
        x: Positions of the links (n,) [rad], changed.
        v: Velocities of the links (n,) [rad/s], changed.
        gain: What the links' velocities gain in the substep (n,) [rad/s], filled.
        mean: Sum of the torques that act on the links (n,) [N m], added to.
    """
    account, n, hs = memory[:ACCOUNT_SIZE].view(ACCOUNT)[0], x.size, law.h / law.substeps
    K, D = _row(gains, LAW_SIZE, STIFFNESS, n), _row(gains, LAW_SIZE, GEAR, n)
    B, damping = _row(gains, LAW_SIZE, ROTOR, n), _row(gains, LAW_SIZE, LINK_DAMPING, n)
    theta, omega = _row(memory, ACCOUNT_SIZE, THETA, n), _row(memory, ACCOUNT_SIZE, OMEGA, n)
    motor, known = _row(memory, ACCOUNT_SIZE, MOTOR, n), _row(memory, ACCOUNT_SIZE, FRICTION, n)
    taken, right, after = _row(memory, ACCOUNT_SIZE, TAKEN, n), scratch(n), scratch(n)
    for i in range(n):
        beta, kappa = B[i] / hs, 0.25 * K[i] * hs + 0.5 * D[i]
        right[i] = momentum[i] + rest[i] - 0.5 * damping[i] * v[i] + K[i] * (theta[i] - x[i])
        right[i] += kappa * (omega[i] - v[i] + push[i] / (beta + kappa))
    times(inverse, right, after)
    rubbed = _row(memory, ACCOUNT_SIZE, RUBBED, n)
    if law.rubs:
        rub(inverse, _row(gains, LAW_SIZE, LINK_DRY, n), rubbed, after)
    for i in range(n):
        beta, kappa = B[i] / hs, 0.25 * K[i] * hs + 0.5 * D[i]
        w = (push[i] + kappa * after[i]) / (beta + kappa)
        torque = K[i] * (theta[i] - x[i]) + kappa * (omega[i] + w - v[i] - after[i])
        speed, link = 0.5 * (omega[i] + w), 0.5 * (v[i] + after[i])
        account.work += hs * motor[i] * speed
        account.loss += hs * (taken[i] * speed + D[i] * (speed - link) * (speed - link))
        account.given += hs * torque * link
        account.rubbed += hs * rubbed[i] * link
        torque -= damping[i] * link + rubbed[i]
        mean[i] += torque
        momentum[i] += rest[i] + torque
        known[i] += law.observes * (motor[i] - sensed[i] - beta * (w - omega[i]) - known[i])
        theta[i] += hs * speed
        x[i] += hs * link
        gain[i] = after[i] - v[i]
        omega[i], v[i] = w, after[i]


@compiled
def _close_loop(gains: Array, law: Law, memory: Array, ring: Array, x: Array, v: Array) -> None:
    """The torque loop: what it senses, and the motors' torques that follow after their lag."""
    n = x.size
    loop = _row(gains, LAW_SIZE, LOOP, n)
    theta, omega = _row(memory, ACCOUNT_SIZE, THETA, n), _row(memory, ACCOUNT_SIZE, OMEGA, n)
    account = memory[:ACCOUNT_SIZE].view(ACCOUNT)[0]
    acting = IMPEDED if account.refers else COMMAND
    motor, command = _row(memory, ACCOUNT_SIZE, MOTOR, n), _row(memory, ACCOUNT_SIZE, acting, n)
    known = _row(memory, ACCOUNT_SIZE, FRICTION, n)
    for k in range(law.delay, 0, -1):
        for i in range(2 * n):
            ring[2 * n * k + i] = ring[2 * n * (k - 1) + i]
    for i in range(n):
        ring[i] = _felt(gains, law, n, i, theta[i], x[i], omega[i] - v[i])
        ring[n + i] = omega[i] - v[i]
    late = 2 * n * law.delay
    for i in range(n):
        wanted = law.ratio * (command[i] - loop[i] * ring[late + n + i])
        wanted += (1.0 - law.ratio) * ring[late + i]
        wanted += known[i]
        motor[i] = law.keep * motor[i] + (1.0 - law.keep) * wanted


@compiled
def _felt(gains: Array, law: Law, n: int, i: int, theta: float, x: float, relative: float) -> float:
    """What a torque sensor says [N m]: the torque of its gear, bias and ripple."""
    torque: float = (
        gains[LAW_SIZE + STIFFNESS * n + i] * (theta - x) + gains[LAW_SIZE + GEAR * n + i] * relative
    )
    torque += gains[LAW_SIZE + BIAS * n + i]
    ripple = gains[LAW_SIZE + WAVE * n + i]
    if ripple != 0.0:  # a sine costs as much as the rest
        torque += ripple * math.sin(law.waves * theta)
    return torque


@compiled
def _friction(gains: Array, law: Law, n: int, i: int, theta: float, omega: float, free: float) -> float:
    """Friction and ripple of a motor over a substep [N m]; `free` [N m] is what would have to be held."""
    coulomb, static = gains[LAW_SIZE + COULOMB * n + i], gains[LAW_SIZE + STATIC * n + i]
    smooth: float = gains[LAW_SIZE + VISCOUS * n + i] * omega
    ripple, most = gains[LAW_SIZE + RIPPLE * n + i], coulomb
    if ripple != 0.0:
        smooth += ripple * math.sin(law.waves * theta)
    if static > coulomb:
        ratio = omega / law.stribeck
        most += (static - coulomb) * math.exp(-ratio * ratio)
    dry: float = min(max(free - smooth, -most), most)
    return smooth + dry


@compiled
def end_step(gains: Array, world: World, memory: Array, out: Array) -> int:
    """After `mj_step2`: the links end where the substeps say; remember the other forces on them."""
    law, n, nv, first = gains[:LAW_SIZE].view(LAW)[0], world.q.size, world.nv, world.first_dof
    qpos, moved = vector(world.qpos, world.nq), _row(memory, ACCOUNT_SIZE, MOVED, n)
    others = _row(memory, ACCOUNT_SIZE, OTHERS, n)
    smooth, passive, bias = vector(law.smooth, nv), vector(law.passive, nv), vector(world.qfrc_bias, nv)
    actuator, constraint = vector(law.actuator, nv), vector(law.constraint, nv)
    for i in range(n):
        at = first + i
        qpos[world.first_qpos + i] += moved[i]
        others[i] = smooth[at] - passive[at] + bias[at] - actuator[at] + constraint[at]
    of_shaft = memory[ACCOUNT_SIZE + _ROWS * n + nv * nv :]
    for i in range(law.bends):
        at = first + n + i
        of_shaft[i] = smooth[at] - passive[at] + bias[at] + constraint[at]
    return GOES_ON


@compiled
def feel(gains: Array, world: World, memory: Array, out: Array) -> int:
    """What is measured: the gears' torques, and the joints by encoders on the links or on the motors.

    Those on the motors are reported as arms do, q_m = theta - tau_m / K with the measured torque.
    """
    law, n = gains[:LAW_SIZE].view(LAW)[0], world.q.size
    K = _row(gains, LAW_SIZE, STIFFNESS, n)
    theta, omega = _row(memory, ACCOUNT_SIZE, THETA, n), _row(memory, ACCOUNT_SIZE, OMEGA, n)
    for i in range(n):
        world.tau_m[i] = _felt(gains, law, n, i, theta[i], world.q[i], omega[i] - world.v[i])
        if law.at_motor:
            world.q_m[i], world.v_m[i] = theta[i] - world.tau_m[i] / K[i], omega[i]
    return GOES_ON


@compiled
def record(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Columns: the gears' torques, the motors' speeds, energies; the arm's own loop."""
    law, account, n = gains[:LAW_SIZE].view(LAW)[0], memory[:ACCOUNT_SIZE].view(ACCOUNT)[0], world.q.size
    K, D = _row(gains, LAW_SIZE, STIFFNESS, n), _row(gains, LAW_SIZE, GEAR, n)
    B = _row(gains, LAW_SIZE, ROTOR, n)
    theta, omega = _row(memory, ACCOUNT_SIZE, THETA, n), _row(memory, ACCOUNT_SIZE, OMEGA, n)
    stored = -account.stored_at_start
    for i in range(n):
        s = theta[i] - world.q[i]
        out[i] = K[i] * s + D[i] * (omega[i] - world.v[i])
        out[n + i] = omega[i]
        stored += 0.5 * (K[i] * s * s + B[i] * omega[i] * omega[i])
    out[2 * n], out[2 * n + 1], out[2 * n + 2] = account.work, account.loss, stored
    out[2 * n + 3], out[2 * n + 4] = account.given, account.rubbed
    if law.impedes:
        target, given = _row(memory, ACCOUNT_SIZE, TARGET, n), _row(memory, ACCOUNT_SIZE, IMPEDED, n)
        for i in range(n):
            out[2 * n + 5 + i], out[3 * n + 5 + i] = target[i], given[i]
    return GOES_ON


class JointDrives(PlantPart):
    """The drives of an arm, as a part of the plant.

    Records the gears' torques `joint_torque`, the motors' speeds `motor_speed`, and since the start the work
    of the motors, their loss, the energy in rotors and gears, and that given to the links: work is the sum of
    the other three. What the links' dry friction takes of the last is beside them. Where the arm's own
    impedance loop is commanded, also where its reference is to be, `joint_command`, and its torque,
    `impedance_torque`.

    Args:
        config: The drives, whole: see `DriveConfig.on`.
        rng: From which friction and the signs of the sensors' biases are drawn.
        nominal: The arm as its own impedance loop knows it; needed where that is commanded.

    Raises:
        ValueError: If it is needed and not given.
    """

    rank = LAST
    kernels: Mapping[str, Any] = {
        "actuate": receive,
        "before_step": move,
        "after_step": end_step,
        "sense": feel,
        "values": record,
    }
    ranks: Mapping[str, int] = {"before_step": _BEFORE_ALL, "after_step": _BEFORE_ALL, "sense": 0}

    def __init__(
        self, config: DriveConfig, rng: np.random.Generator, nominal: SceneConfig | None = None
    ) -> None:
        self._c, self._rng = config, rng
        self._nominal: mujoco.MjData | None = None
        if config.impedes:
            if nominal is None:
                raise ValueError("command joint_impedance needs the arm as its own loop knows it")
            self._nominal = mujoco.MjData(build_arm(nominal).model)
        self._n, self._damping, self._dry = 0, np.zeros(0), np.zeros(0)

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Motors' inertia, damping and friction leave MuJoCo's joints, which bear whatever the gears give."""
        names = joint_names(spec)
        self._damping = np.array([np.ravel(spec.joint(name).damping)[0] for name in names])
        self._dry = np.array([spec.joint(name).frictionloss for name in names])
        for name in names:
            spec.joint(name).armature = spec.joint(name).frictionloss = 0.0
            spec.joint(name).damping = np.zeros_like(spec.joint(name).damping)
        for name in motor_names(len(names)):
            spec.actuator(name).ctrllimited = mujoco.mjtLimited.mjLIMITED_FALSE
            spec.actuator(name).forcelimited = mujoco.mjtLimited.mjLIMITED_FALSE

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Draw what differs from joint to joint, settle the numbers, make room for the memory."""
        c, n = self._c, len(scene.dof_ids)
        self._n = n
        self.columns = (
            joints("joint_torque", "nm", n),
            joints("motor_speed", "rad_per_s", n),
            *(scalar(f"drive_{name}", "j") for name in ("work", "loss", "stored", "given", "link_friction")),
        )
        if c.impedes:
            own = (joints("joint_command", "rad", n), joints("impedance_torque", "nm", n))
            self.columns = (*self.columns, *own)
        drive, h = c.values(n), scene.model.opt.timestep
        drawn = copied(self._rng)
        spread = spread_factor(drawn, c.friction_spread, n)
        signs = drawn.choice([-1.0, 1.0], n)
        coulomb = c.each("coulomb_nm", n)
        free = np.full(n, np.inf)
        static = coulomb if c.static_nm is None else c.each("static_nm", n)
        rows = (
            drive.stiffness,
            drive.gear_damping,
            drive.rotor_inertia,
            drive.loop_damping,
            spread * coulomb,
            spread * static,
            spread * c.each("viscous_nm_s_per_rad", n),
            c.each("ripple_nm", n),
            signs * c.each("sensor_bias_nm", n),
            c.each("sensor_ripple_nm", n),
            self._damping,
            self._dry,
            c.each("impedance_stiffness_nm_per_rad", n),
            c.each("impedance_damping_ratio", n),
            c.each("joint_acceleration_rad_per_s2", n) if c.joint_acceleration_rad_per_s2 else free,
            c.each("joint_jerk_rad_per_s3", n) if c.joint_jerk_rad_per_s3 else free,
            scene.limits.torque,
        )
        self.gains = np.concatenate([np.zeros(LAW_SIZE), *rows])
        law = laid_over(Law, self.gains)
        law.substeps = max(1, math.ceil(h / LOOP_S - 1e-9))
        period = h / law.substeps
        law.h, law.ratio = h, c.inertia_shaping
        law.delay = round(c.loop_delay_s / period)
        law.keep = math.exp(-2.0 * math.pi * c.loop_cutoff_hz * period)
        law.observes = -math.expm1(-2.0 * math.pi * c.friction_observer_hz * period)
        law.stribeck, law.waves = c.stribeck_velocity_rad_per_s, float(c.ripple_per_turn)
        law.at_motor = c.encoder == "motor"
        law.past_rate, law.past_motion = _PAST[c.past_torque_rate], _PAST[c.past_joint_motion]
        law.impedes = c.impedes
        if self._nominal is not None:
            data = self._nominal
            law.mj_model, law.mj_data = data.model._address, data._address
            law.qpos, law.qvel = data.qpos.ctypes.data, data.qvel.ctypes.data
        law.rate = drive.torque_rate * dt_s
        cutoff = c.command_cutoff_hz
        law.command_keep = 0.0 if cutoff is None else math.exp(-2.0 * math.pi * cutoff * dt_s)
        law.bends, law.rubs = bend_joints(scene), bool(self._dry.any())
        ring = 2 * (int(law.delay) + 1) * n
        self.memory = np.zeros(ACCOUNT_SIZE + _ROWS * n + scene.model.nv**2 + law.bends + ring)

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """The arm is at rest, held by its drives."""
        n, law = self._n, laid_over(Law, self.gains)
        for name in ("passive", "smooth", "actuator", "constraint"):
            law[name] = getattr(data, f"qfrc_{name}").ctypes.data
        law.damping = scene.model.dof_damping.ctypes.data
        posed = mujoco.MjData(scene.model)
        posed.qpos[:] = data.qpos
        mujoco.mj_forward(scene.model, posed)
        held = (posed.qfrc_bias - posed.qfrc_passive)[scene.dof_ids]
        self.memory[:] = 0.0
        rows = self.memory[ACCOUNT_SIZE : ACCOUNT_SIZE + _ROWS * n].reshape(_ROWS, n)
        drive = self._c.values(n)
        rows[THETA] = data.qpos[scene.qpos_ids] + held / drive.stiffness
        rows[MOTOR] = rows[COMMAND] = held
        sensed = 2 * (int(law.delay) + 1) * n
        self.memory[-sensed:].reshape(-1, 2, n)[:, 0] = held
        laid_over(Account, self.memory).stored_at_start = 0.5 * float(np.sum(held * held / drive.stiffness))
