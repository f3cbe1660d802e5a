"""Energy of the mechanism, step by step: what is in it, and what went in and out.

MuJoCo's step is v+ = v + h a, q+ = q + h v+, with the damping taken at v+. Read as a leapfrog, v and v+ are
the velocities half a step before and after the instant of q. So at each instant the ledger takes

    kinetic energy  T = w' M(q) w / 2,  w = (v + v+)/2,      potentials at q,
    work            W += h v' (Q- + Q)/2  over the step h v that led from the last instant to this one,

with each generalized force Q (the damping as -D v+, which is what acted). Each is of second order in h, a
plain sum of Q v h of first. The residual is what the integrator itself gains or loses (Coriolis forces, which
it takes at v, leave a small part of first order):

    residual = change of (kinetic + potential + spring) - (works - losses).

Springs are those of slide and hinge joints. Source: the Störmer-Verlet scheme, e.g. Hairer, Lubich and
Wanner, Geometric Numerical Integration, section I.1.
"""

from typing import ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.models.build import Scene
from surgsim.plant.port import Port

Array = NDArray[np.float64]
_ACTUATOR, _APPLIED, _DAMPING, _FRICTION, _CONTACT, _SEAL = range(6)
_FORCES = 6


class EnergyLedger:
    """Energies and works since `start`, in joules.

    kinetic, potential (gravity) and spring are changes since the start. The wall's spring is taken from its
    moving place of rest; what moves that place does `applied_work`, as does all of `qfrc_applied` and
    `xfrc_applied` that is not the bore's. `damping_loss` and `friction_loss` (dry friction of joints and
    seal) are positive when energy leaves. `contact_work` is what the bore's contact and all of MuJoCo's
    constraints but dry friction put in. `contact_stored`, for information, is the elastic energy of bore and
    seal: the part of contact_work and friction_loss that can come back.

    Args:
        scene: The compiled scene.
        data: Its data.
        port: The port that acts in it; without it the bore's forces and the wall's motion are `applied_work`.
    """

    COLUMNS: ClassVar[tuple[str, ...]] = (
        "kinetic",
        "potential",
        "spring",
        "actuator_work",
        "applied_work",
        "damping_loss",
        "friction_loss",
        "contact_work",
        "contact_stored",
        "residual",
    )

    def __init__(self, scene: Scene, data: mujoco.MjData, port: Port | None = None) -> None:
        model, nv = scene.model, scene.model.nv
        self._model, self._data = model, data
        self._wall = None if port is None else port.wall
        self._h = float(model.opt.timestep)
        self._forces = _forces_of(data)
        self._damping = np.array(model.dof_damping)
        self._xipos, self._weight = data.xipos, -np.outer(model.body_mass, model.opt.gravity)
        springs = np.flatnonzero(model.jnt_stiffness)
        self._stiffness, self._spring_places = model.jnt_stiffness[springs], model.jnt_qposadr[springs]
        self._spring_rest, self._stretch = model.qpos_spring[self._spring_places], np.zeros(len(springs))
        self._before, self._momentum = np.zeros(nv), np.zeros(nv)
        self._now, self._last = np.zeros((_FORCES, nv)), np.zeros((_FORCES, nv))
        self._now_drive, self._last_drive, self._last_offset = np.zeros(3), np.zeros(3), np.zeros(3)
        self._works, self._energy, self._energy_at_start = np.zeros(_FORCES), np.zeros(3), np.zeros(3)
        self._begun = False

    def start(self) -> None:
        """Begin again at the next step: everything counts from its instant."""
        self._works[:] = self._energy[:] = self._energy_at_start[:] = 0.0
        self._begun = False

    def before_step(self) -> None:
        """Call when positions, velocities and all forces of the instant are set, before `mj_step2`."""
        self._before[:] = self._data.qvel
        self._stretch[:] = self._data.qpos[self._spring_places] - self._spring_rest

    def after_step(self) -> None:
        """Call after `mj_step2` or `mj_step`; accounts for the instant at which the step began."""
        self._read_forces()
        if self._begun:
            self._add_work()
        self._read_energy()
        if not self._begun:
            self._energy_at_start[:] = self._energy
            self._begun = True
        self._now, self._last = self._last, self._now
        if self._wall is not None:
            self._last_drive[:] = self._now_drive
            self._last_offset[:] = self._wall.offset

    def terms(self) -> Array:
        """The terms of `COLUMNS` (10,) [J], at the beginning of the last step."""
        works, change = self._works, self._energy - self._energy_at_start
        stored = 0.0 if self._wall is None else float(self._wall.stored.sum())
        return (
            np.array(
                [
                    *change,
                    works[_ACTUATOR],
                    works[_APPLIED],
                    -works[_DAMPING],
                    -works[_FRICTION] - works[_SEAL],
                    works[_CONTACT],
                    stored if self._begun else 0.0,
                    change.sum() - works.sum(),
                ]
            )
            + 0.0
        )  # no negative zeros

    def _read_forces(self) -> None:
        """Generalized forces that acted at the instant of `qpos` before the step (6, nv)."""
        now, (qvel, actuator, smooth, passive, bias, constraint, spring) = self._now, self._forces
        now[_ACTUATOR] = actuator
        now[_APPLIED] = smooth - passive + bias - actuator
        now[_DAMPING] = -self._damping * qvel
        now[_FRICTION] = self._joint_friction() if self._data.nefc else 0.0
        now[_CONTACT] = constraint - now[_FRICTION]
        if self._wall is None:
            return
        wall, dofs = self._wall, self._wall.dofs
        now[_APPLIED] -= wall.contact + wall.seal + wall.drive
        now[_CONTACT] += wall.contact
        now[_SEAL] = wall.seal
        now[_DAMPING, dofs] += wall.damping * wall.velocity
        self._now_drive[:] = spring[dofs] + wall.stiffness * wall.offset + now[_DAMPING, dofs]

    def _joint_friction(self) -> Array:
        data = self._data
        friction = np.zeros(self._model.nv)
        rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF
        np.add.at(friction, data.efc_id[rows], data.efc_force[rows])
        return friction

    def _add_work(self) -> None:
        """Work over the step that led to this instant."""
        step = self._h * self._before
        mean = 0.5 * (self._last + self._now)
        self._works += mean @ step
        if self._wall is not None:
            moved = self._wall.offset - self._last_offset
            drive = 0.5 * (self._last_drive + self._now_drive)
            self._works[_DAMPING] -= float(mean[_DAMPING, self._wall.dofs] @ moved)
            self._works[_APPLIED] += float(drive @ moved)

    def _read_energy(self) -> None:
        """Energies at the instant before the step: M and positions are still its."""
        velocity = 0.5 * (self._before + self._data.qvel)
        mujoco.mj_mulM(self._model, self._data, self._momentum, velocity)
        self._energy[0] = 0.5 * float(self._momentum @ velocity)
        self._energy[1] = np.vdot(self._weight, self._xipos)
        self._energy[2] = 0.5 * float(self._stiffness @ self._stretch**2)
        if self._wall is not None:
            offset = self._wall.offset
            force = self._forces[-1][self._wall.dofs] + 0.5 * self._wall.stiffness * offset
            self._energy[2] += float(force @ offset)


def _forces_of(data: mujoco.MjData) -> tuple[Array, ...]:
    """Velocity and generalized forces of MuJoCo's data, not copied."""
    return (
        data.qvel,
        data.qfrc_actuator,
        data.qfrc_smooth,
        data.qfrc_passive,
        data.qfrc_bias,
        data.qfrc_constraint,
        data.qfrc_spring,
    )
