"""The master console: a force-controlled haptic arm in its own MuJoCo model, with its energy account."""

import math
from functools import cache
from typing import ClassVar

import mujoco
from pydantic import PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.resources import resource_dir
from surgsim.tick.algebra import norm, times, transposed_times
from surgsim.tick.arrays import Record, new
from surgsim.tick.mujoco_calls import mj_jacSite, mj_step1, mj_step2
from surgsim.tick.views import vector

JOINTS = ("yaw", "shoulder", "elbow", "gimbal_yaw", "gimbal_pitch", "gimbal_roll")
_N = len(JOINTS)
AT_STOP_RAD = 0.002
"""A joint nearer to the end of its range than this is on its stop."""


class ConsoleConfig(PartConfig):
    """Physics step and force limit of the master console.

    `timestep_s` is the control period by default, or a whole part of it. `force_limit_n` cuts the norm of a
    force; the motors' torque limits cut it further, to 3.9 N sideways and 3.2 N upwards at the home pose.
    `least_mass_kg` is a lower bound of the mass felt at the handle in any direction (0.234 kg over the
    joints' ranges); the tank predicts with it what a force will cost.
    """

    timestep_s: PositiveFloat | None = None
    force_limit_n: PositiveFloat = 6.0
    least_mass_kg: PositiveFloat = 0.2

    def substeps(self, period_s: float) -> int:
        """Physics steps in a control period.

        Raises:
            ValueError: If that is no whole number.
        """
        ratio = 1.0 if self.timestep_s is None else period_s / self.timestep_s
        if ratio < 0.5 or abs(ratio - round(ratio)) > 1e-9 * ratio:
            raise ValueError(
                f"control period {period_s:g} must be a multiple of timestep_s {self.timestep_s:g}"
            )
        return round(ratio)


class ConsoleState(Record):
    """What the console measures.

    Attributes:
        t_s: Time since the reset [s].
        q: Joint positions (6,) [rad].
        v: Joint velocities (6,) [rad/s].
        position: Handle position in O (3,) [m].
        rotation: Handle axes in O (3, 3).
        velocity: Handle velocity (3,) [m/s].
        angular_velocity: Handle angular velocity in O (3,) [rad/s].
        stop: Number of the joint on its stop, the first of `JOINTS` is 1; 0 if none is.
        room_rad: Way that is left to the nearest stop of a joint [rad].
    """

    SHAPES: ClassVar[dict[str, str]] = {
        "q": str(_N),
        "v": str(_N),
        "position": "3",
        "rotation": "3 3",
        "velocity": "3",
        "angular_velocity": "3",
    }
    t_s: float
    q: Array
    v: Array
    position: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array
    stop: int
    room_rad: float


class ConsoleEnergy(Record):
    """Energy account since the reset [J].

    Attributes:
        kinetic_j: Now.
        potential_j: Now, minus that at the reset.
        motor_j: Work of all motor torques.
        gravity_compensation_j: The part of `motor_j` that compensates gravity.
        hand_j: Work of the hand on the handle.
        damping_j: Burnt by viscous joint friction.
        friction_j: Burnt by dry joint friction and the joints' stops.
        rendered_j: Work of the rendered force alone.
        residual_j: Stored - brought in + burnt: zero but for the integration error.
    """

    kinetic_j: float
    potential_j: float
    motor_j: float
    gravity_compensation_j: float
    hand_j: float
    damping_j: float
    friction_j: float
    rendered_j: float
    residual_j: float


class ConsoleLaw(Record):
    """Numbers of the console, and where MuJoCo's arrays are.

    Attributes:
        mj_model: Address of MuJoCo's model.
        mj_data: Address of MuJoCo's data.
        qpos: Address of the joint positions; as the following, of the array of MuJoCo's data by that name.
        qvel: Joint velocities.
        ctrl: Controls.
        qfrc_applied: Applied generalized forces.
        qfrc_actuator: Of the motors, gravity compensation included.
        qfrc_gravcomp: Of gravity compensation.
        qfrc_constraint: Of dry friction and stops.
        energy: Potential and kinetic energy.
        site_xpos: The handle's place.
        site_xmat: Its orientation.
        site: Its site.
        substeps: Physics steps in a control period.
        timestep_s: Physics step [s].
        force_limit_n: As in `ConsoleConfig`.
        least_mass_kg: As in `ConsoleConfig`.
        torque_limit: Of the motors (6,) [N m].
        damping: Viscous joint friction (6,) [N m s/rad].
        q_min: Where the joints' ranges begin (6,) [rad].
        q_max: Where they end (6,) [rad].
    """

    SHAPES: ClassVar[dict[str, str]] = {
        name: str(_N) for name in ("torque_limit", "damping", "q_min", "q_max")
    }
    mj_model: int
    mj_data: int
    qpos: int
    qvel: int
    ctrl: int
    qfrc_applied: int
    qfrc_actuator: int
    qfrc_gravcomp: int
    qfrc_constraint: int
    energy: int
    site_xpos: int
    site_xmat: int
    site: int
    substeps: int
    timestep_s: float
    force_limit_n: float
    least_mass_kg: float
    torque_limit: Array
    damping: Array
    q_min: Array
    q_max: Array


class ConsoleMemory(Record):
    """State of the console beside MuJoCo's.

    Attributes:
        state: What it measures.
        account: Its energy.
        potential_j: Potential energy at the reset [J].
        J: Jacobian of the handle (6, 6).
        before: Joint velocities before a step (6,) [rad/s].
        moved: Path of the joints over a step (6,) [rad].
    """

    SHAPES: ClassVar[dict[str, str]] = {"J": f"6 {_N}", "before": str(_N), "moved": str(_N)}
    state: ConsoleState
    account: ConsoleEnergy
    potential_j: float
    J: Array
    before: Array
    moved: Array


def load_console() -> mujoco.MjModel:
    """Model of the console."""
    return mujoco.MjModel.from_xml_path(str(resource_dir("assets") / "console" / "console.xml"))


@compiled
def measure_console(law: ConsoleLaw, console: ConsoleMemory) -> None:
    """Fill the Jacobian, the state and the energies of the present instant."""
    J, state, account = console.J, console.state, console.account
    mj_jacSite(law.mj_model, law.mj_data, J.ctypes.data, J.ctypes.data + 8 * 3 * _N, law.site)
    place, turn = vector(law.site_xpos, 3), vector(law.site_xmat, 9)
    qpos, qvel, energy = vector(law.qpos, _N), vector(law.qvel, _N), vector(law.energy, 2)
    state.stop, state.room_rad = 0, math.inf
    for i in range(_N):
        state.q[i], state.v[i] = qpos[i], qvel[i]
        if not law.q_min[i] + AT_STOP_RAD < qpos[i] < law.q_max[i] - AT_STOP_RAD:
            state.stop = i + 1
        state.room_rad = min(state.room_rad, qpos[i] - law.q_min[i], law.q_max[i] - qpos[i])
    times(J[:3], qvel, state.velocity)
    times(J[3:], qvel, state.angular_velocity)
    for i in range(3):
        state.position[i] = place[i]
        for k in range(3):
            state.rotation[i, k] = turn[3 * i + k]
    account.kinetic_j, account.potential_j = energy[1], energy[0] - console.potential_j
    account.rendered_j = account.motor_j - account.gravity_compensation_j
    account.residual_j = account.kinetic_j + account.potential_j - (account.motor_j + account.hand_j)
    account.residual_j += account.damping_j + account.friction_j


@compiled
def step_console(law: ConsoleLaw, console: ConsoleMemory, wrench: Array, hand_wrench: Array) -> None:
    """Advance one control period under constant forces.

    Joint torques: tau = J^T F + g(q), cut at each motor's limit; J of the handle's site.

    Args:
        law: Its numbers.
        console: Its state.
        wrench: Force and torque that the motors should render at the handle, in O (6,) [N, N m].
        hand_wrench: Force and torque of the hand on the handle, in O (6,) [N, N m].
    """
    transposed_times(console.J, wrench, vector(law.ctrl, _N))
    for _ in range(law.substeps):
        transposed_times(console.J, hand_wrench, vector(law.qfrc_applied, _N))
        _step_physics(law, console)
        console.state.t_s += law.timestep_s
        measure_console(law, console)


@compiled
def _step_physics(law: ConsoleLaw, console: ConsoleMemory) -> None:
    """One physics step; work is force times the step's mean velocity (exact for a constant mass)."""
    qvel, before, moved, account = vector(law.qvel, _N), console.before, console.moved, console.account
    for i in range(_N):
        before[i] = qvel[i]
    mj_step2(law.mj_model, law.mj_data)
    actuator, gravity = vector(law.qfrc_actuator, _N), vector(law.qfrc_gravcomp, _N)
    applied, constraint = vector(law.qfrc_applied, _N), vector(law.qfrc_constraint, _N)
    motor = compensation = hand = damping = friction = 0.0
    for i in range(_N):
        moved[i] = 0.5 * law.timestep_s * (before[i] + qvel[i])
        motor += actuator[i] * moved[i]
        compensation += gravity[i] * moved[i]
        hand += applied[i] * moved[i]
        damping += law.damping[i] * qvel[i] * moved[i]  # implicit in the velocity, as the integrator has it
        friction -= constraint[i] * moved[i]
    account.motor_j += motor
    account.gravity_compensation_j += compensation
    account.hand_j += hand
    account.damping_j += damping
    account.friction_j += friction
    mj_step1(law.mj_model, law.mj_data)


@compiled
def renderable(law: ConsoleLaw, console: ConsoleMemory, force: Array) -> None:
    """Shorten `force` at the handle in O (3,) [N] to what the limit and the motors allow.

    By the largest factor in [0, 1] that keeps |F| and every |J^T F + g| within its limit.
    """
    gravity, J = vector(law.qfrc_gravcomp, _N), console.J
    size = norm(force)
    factor = law.force_limit_n / size if size > law.force_limit_n else 1.0
    for i in range(_N):
        torque = force[0] * J[0, i] + force[1] * J[1, i] + force[2] * J[2, i]
        room = law.torque_limit[i] - gravity[i] if torque > 0.0 else law.torque_limit[i] + gravity[i]
        if factor * abs(torque) > room:
            factor = max(room, 0.0) / abs(torque)
    for i in range(3):
        force[i] = factor * force[i]


class Console:
    """A console's model and data, and what kernels need of it.

    Attributes:
        model: MuJoCo's model.
        data: MuJoCo's data.
    """

    def __init__(self, config: ConsoleConfig, period_s: float = 0.001) -> None:
        self._c, self._substeps = config, config.substeps(period_s)
        self.model = load_console()
        self.model.opt.timestep = period_s / self._substeps
        self.data = mujoco.MjData(self.model)

    def describe(self, law: "ConsoleLaw") -> None:
        """Fill the law, valid as long as this object lives."""
        c, model, data = self._c, self.model, self.data
        law.mj_model, law.mj_data = model._address, data._address
        for name in (
            "qpos",
            "qvel",
            "ctrl",
            "qfrc_applied",
            "qfrc_actuator",
            "qfrc_gravcomp",
            "qfrc_constraint",
            "energy",
        ):
            law[name] = getattr(data, name).ctypes.data
        law.site = model.site("handle").id
        law.site_xpos = data.site_xpos[law.site].ctypes.data
        law.site_xmat = data.site_xmat[law.site].ctypes.data
        law.substeps, law.timestep_s = self._substeps, model.opt.timestep
        law.force_limit_n, law.least_mass_kg = c.force_limit_n, c.least_mass_kg
        law.torque_limit[:], law.damping[:] = model.jnt_actfrcrange[:, 1], model.dof_damping.reshape(-1)
        law.q_min[:], law.q_max[:] = model.jnt_range.T

    def reset(self, law: "ConsoleLaw", memory: "ConsoleMemory") -> None:
        """Put the arm at rest at its home pose; `memory` must be zeros."""
        mujoco.mj_resetDataKeyframe(self.model, self.data, self.model.key("home").id)
        mujoco.mj_step1(self.model, self.data)
        memory.potential_j = self.data.energy[0]
        measure_console(law, memory)


@cache
def home_room_rad() -> float:
    """Way from the home pose to the nearest stop of a joint [rad]; every check of a teleoperation asks."""
    model = load_console()
    home = model.key("home").qpos
    return float(min((home - model.jnt_range[:, 0]).min(), (model.jnt_range[:, 1] - home).min()))


def new_console(config: ConsoleConfig, period_s: float = 0.001) -> tuple[Console, ConsoleLaw, ConsoleMemory]:
    """A console at rest with its numbers (`ConsoleLaw`) and its state (`ConsoleMemory`)."""
    console, law, memory = Console(config, period_s), new(ConsoleLaw, 0), new(ConsoleMemory, 0)
    console.describe(law)
    console.reset(law, memory)
    return console, law, memory
