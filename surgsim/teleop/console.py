"""The master console: a force-controlled haptic arm in its own MuJoCo model, with its energy account."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.resources import resource_dir

Array = NDArray[np.float64]
JOINTS = ("yaw", "shoulder", "elbow", "gimbal_yaw", "gimbal_pitch", "gimbal_roll")


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


@dataclass(frozen=True, kw_only=True, slots=True)
class ConsoleState:
    """What the console measures.

    Attributes:
        t_s: Time since the reset.
        q: Joint positions (6,) [rad].
        v: Joint velocities (6,) [rad/s].
        position: Handle position in O (3,) [m].
        rotation: Handle axes in O (3, 3).
        velocity: Handle velocity (3,) [m/s].
        angular_velocity: Handle angular velocity in O (3,) [rad/s].
    """

    t_s: float
    q: Array
    v: Array
    position: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array


@dataclass(frozen=True, kw_only=True, slots=True)
class ConsoleEnergy:
    """Energy account since the reset [J].

    Attributes:
        kinetic_j: Now.
        potential_j: Now, minus that at the reset.
        motor_j: Work of all motor torques.
        gravity_compensation_j: The part of `motor_j` that compensates gravity.
        hand_j: Work of the hand on the handle.
        damping_j: Burnt by viscous joint friction.
        friction_j: Burnt by dry joint friction and the joints' stops.
    """

    kinetic_j: float
    potential_j: float
    motor_j: float
    gravity_compensation_j: float
    hand_j: float
    damping_j: float
    friction_j: float

    @property
    def rendered_j(self) -> float:
        """Work of the rendered force alone."""
        return self.motor_j - self.gravity_compensation_j

    @property
    def residual_j(self) -> float:
        """Stored - brought in + burnt: zero but for the integration error."""
        brought = self.motor_j + self.hand_j
        return self.kinetic_j + self.potential_j - brought + self.damping_j + self.friction_j


@compiled
def _rendered_part(force: Array, J: Array, gravity: Array, torque_limit: Array, force_limit: float) -> float:
    """Largest factor in [0, 1] that keeps |F| and every |J^T F + g| within its limit."""
    norm = math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    factor = force_limit / norm if norm > force_limit else 1.0
    for i in range(J.shape[1]):
        torque = force[0] * J[0, i] + force[1] * J[1, i] + force[2] * J[2, i]
        room = torque_limit[i] - gravity[i] if torque > 0.0 else torque_limit[i] + gravity[i]
        if factor * abs(torque) > room:
            factor = max(room, 0.0) / abs(torque)
    return factor


def load_console() -> mujoco.MjModel:
    """Model of the console."""
    return mujoco.MjModel.from_xml_path(str(resource_dir("assets") / "console" / "console.xml"))


class Console:
    """The console's physics. `step` advances one control period under constant forces.

    Joint torques: tau = J^T F + g(q), cut at each motor's limit; J of the handle's site.
    """

    def __init__(self, config: ConsoleConfig, period_s: float = 0.001) -> None:
        self.config = config
        self._substeps = config.substeps(period_s)
        self._timestep = period_s / self._substeps
        self.model = load_console()
        self.model.opt.timestep = self._timestep
        self.data = mujoco.MjData(self.model)
        self._site = self.model.site("handle").id
        self._home = self.model.key("home").id
        self._J = np.zeros((6, self.model.nv))
        self._torque_limit = self.model.jnt_actfrcrange[:, 1].copy()
        self._damping = self.model.dof_damping.copy().reshape(-1)
        self._work = np.zeros(5)
        self.reset()

    def reset(self) -> ConsoleState:
        """Put the arm at rest at its home pose and clear the account."""
        mujoco.mj_resetDataKeyframe(self.model, self.data, self._home)
        mujoco.mj_step1(self.model, self.data)
        self._refresh()
        self._potential_at_start = float(self.data.energy[0])
        self._work = np.zeros(5)
        return self.state()

    def step(self, wrench: Array, hand_wrench: Array) -> ConsoleState:
        """Advance one control period.

        Args:
            wrench: Force and torque that the motors should render at the handle, in O (6,) [N, N m].
            hand_wrench: Force and torque of the hand on the handle, in O (6,) [N, N m].
        """
        self.data.ctrl[:] = wrench @ self._J
        for _ in range(self._substeps):
            self.data.qfrc_applied[:] = hand_wrench @ self._J
            self._substep()
        return self.state()

    def state(self) -> ConsoleState:
        """Copies of what the console measures now."""
        data = self.data
        twist = self._J @ data.qvel
        return ConsoleState(
            t_s=float(data.time),
            q=data.qpos.copy(),
            v=data.qvel.copy(),
            position=data.site_xpos[self._site].copy(),
            rotation=data.site_xmat[self._site].reshape(3, 3).copy(),
            velocity=twist[:3],
            angular_velocity=twist[3:],
        )

    def renderable(self, force: Array) -> Array:
        """`force` at the handle in O (3,) [N], shortened to what the limit and the motors allow."""
        factor = _rendered_part(
            force, self._J, self.data.qfrc_gravcomp, self._torque_limit, self.config.force_limit_n
        )
        return force if factor == 1.0 else factor * force

    def energy(self) -> ConsoleEnergy:
        """The account since the reset."""
        motor, compensation, hand, damping, friction = self._work.tolist()
        return ConsoleEnergy(
            kinetic_j=float(self.data.energy[1]),
            potential_j=float(self.data.energy[0]) - self._potential_at_start,
            motor_j=motor,
            gravity_compensation_j=compensation,
            hand_j=hand,
            damping_j=damping,
            friction_j=friction,
        )

    @property
    def rendered_j(self) -> float:
        """Work of the rendered force since the reset, without gravity compensation [J]."""
        return float(self._work[0] - self._work[1])

    def _substep(self) -> None:
        """One physics step; work is force times the step's mean velocity (exact for a constant mass)."""
        data = self.data
        before = data.qvel.copy()
        mujoco.mj_step2(self.model, data)
        after = data.qvel
        path = 0.5 * self._timestep * (before + after)
        forces = np.array(
            [
                data.qfrc_actuator,
                data.qfrc_gravcomp,
                data.qfrc_applied,
                self._damping * after,  # implicit in the velocity, as the integrator has it
                -data.qfrc_constraint,
            ]
        )
        self._work += forces @ path
        mujoco.mj_step1(self.model, data)
        self._refresh()

    def _refresh(self) -> None:
        mujoco.mj_jacSite(self.model, self.data, self._J[:3], self._J[3:], self._site)
