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

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.plant.bore import Bore, Push
from surgsim.tick.arrays import Record, World
from surgsim.tick.mujoco_calls import mj_mulM
from surgsim.tick.overlay import laid_over, overlay
from surgsim.tick.python_part import PythonPart, enter
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import vector

_ACTUATOR, _APPLIED, _DAMPING, _FRICTION, _CONTACT, _SEAL = range(6)
_FORCES = 6
_PLACE, _STIFFNESS, _REST, _SPRING = range(4)
"""Places in a spring's row, and its length."""


class Law(Record):
    """Numbers of the ledger.

    After it in the gains stand the damping (nv,), which degrees of freedom are the arm's (nv,), 1 or 0, the
    weights (nbody, 3) [N], and the springs (k, 3).

    Attributes:
        actuator: Address of `qfrc_actuator`; as the following four of MuJoCo's arrays.
        smooth: Of `qfrc_smooth`.
        passive: Of `qfrc_passive`.
        constraint: Of `qfrc_constraint`.
        spring: Of `qfrc_spring`.
        friction: Of the dry friction of the joints (nv,) [N m].
        contact_arm: Of the bore's forces, as the following; see `surgsim.plant.bore.Bore`.
        contact_shaft: Contact's at the joints of a shaft that bends.
        contact_cannula: Contact's on the cannula.
        seal_arm: Seal's on the arm.
        seal_shaft: Seal's at the joints of a shaft that bends.
        seal_cannula: Seal's on the cannula.
        drive: Force of the wall's motion.
        offset: How far its place of rest has moved.
        velocity: How fast.
        stored: Elastic energies.
        wall_stiffness: Of the slides.
        wall_damping: Of the slides.
        walled: Whether there is a wall.
        cannula: Where the slides' velocities begin.
        bends: Number of the joints of a shaft that bends.
        rubs: Whether joints have dry friction.
        springs: Number of springs.
        h: Physics step [s].
        entry: What finds the dry friction in Python (1,).
    """

    SHAPES: ClassVar[dict[str, str]] = {"entry": "1"}
    actuator: int
    smooth: int
    passive: int
    constraint: int
    spring: int
    friction: int
    contact_arm: int
    contact_shaft: int
    contact_cannula: int
    seal_arm: int
    seal_shaft: int
    seal_cannula: int
    drive: int
    offset: int
    velocity: int
    stored: int
    wall_stiffness: int
    wall_damping: int
    walled: int
    cannula: int
    bends: int
    rubs: int
    springs: int
    h: float
    entry: Array


class State(Record):
    """What the ledger remembers; after it the arrays of `Tables`.

    Attributes:
        begun: Whether a step was seen.
        works: Of each force (6,) [J].
        energy: Kinetic, potential and spring (3,) [J].
        energy_at_start: The same at the first step.
        last_offset: Of the wall at the instant before (3,) [m].
        now_drive: Force that the wall's motion works against (3,) [N].
        last_drive: At the instant before.
    """

    SHAPES: ClassVar[dict[str, str]] = {
        "works": str(_FORCES),
        **{name: "3" for name in ("energy", "energy_at_start", "last_offset", "now_drive", "last_drive")},
    }
    begun: int
    works: Array
    energy: Array
    energy_at_start: Array
    last_offset: Array
    now_drive: Array
    last_drive: Array


LAW, LAW_SIZE = overlay(Law)
STATE, STATE_SIZE = overlay(State)
_BEFORE, _MEAN, _MOMENTUM, _NOW, _LAST, _ROWS = 0, 1, 2, 3, 3 + _FORCES, 3 + 2 * _FORCES
"""Rows (nv,) after the state: velocity before the step, mean velocity, momentum, forces now and before."""


@compiled
def _rows(memory: Array, nv: int) -> Array:
    """The rows after the state (15, nv)."""
    return memory[STATE_SIZE : STATE_SIZE + _ROWS * nv].reshape(_ROWS, nv)


@compiled
def _springs(gains: Array, world: World) -> Array:
    """The springs (k, 3)."""
    return gains[LAW_SIZE + 2 * world.nv + 3 * world.nbody :].reshape(-1, _SPRING)


@compiled
def _own(gains: Array, world: World) -> Array:
    """Which degrees of freedom are the arm's (nv,), 1 or 0."""
    return gains[LAW_SIZE + world.nv : LAW_SIZE + 2 * world.nv]


@compiled
def before_step(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Call when positions, velocities and all forces of the instant are set, before `mj_step2`."""
    law, rows = gains[:LAW_SIZE].view(LAW)[0], _rows(memory, world.nv)
    qvel, qpos = vector(world.qvel, world.nv), vector(world.qpos, world.nq)
    own = _own(gains, world)
    for i in range(world.nv):
        rows[_BEFORE, i] = own[i] * qvel[i]
    springs, stretch = _springs(gains, world), memory[STATE_SIZE + _ROWS * world.nv :]
    for k in range(law.springs):
        stretch[k] = qpos[int(springs[k, _PLACE])] - springs[k, _REST]
    return GOES_ON


@compiled
def after_step(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Call after `mj_step2` or `mj_step`; accounts for the instant at which the step began."""
    law, state = gains[:LAW_SIZE].view(LAW)[0], memory[:STATE_SIZE].view(STATE)[0]
    status = GOES_ON
    if law.rubs:
        status = enter(law.entry)
    _read_forces(gains, law, world, memory, state)
    if state.begun:
        _add_work(law, world, memory, state)
    _read_energy(gains, law, world, memory, state)
    if not state.begun:
        state.begun = 1
        for k in range(3):
            state.energy_at_start[k] = state.energy[k]
    rows = _rows(memory, world.nv)
    for k in range(_FORCES):
        for i in range(world.nv):
            rows[_LAST + k, i] = rows[_NOW + k, i]
    if law.walled:
        offset = vector(law.offset, 3)
        for k in range(3):
            state.last_drive[k], state.last_offset[k] = state.now_drive[k], offset[k]
    return status


@compiled
def _read_forces(gains: Array, law: Law, world: World, memory: Array, state: State) -> None:
    """Generalized forces that acted at the instant of `qpos` before the step (6, nv)."""
    nv, now, damping = world.nv, _rows(memory, world.nv)[_NOW:_LAST], gains[LAW_SIZE : LAW_SIZE + world.nv]
    qvel, bias, friction = vector(world.qvel, nv), vector(world.qfrc_bias, nv), vector(law.friction, nv)
    actuator, smooth, passive = vector(law.actuator, nv), vector(law.smooth, nv), vector(law.passive, nv)
    constraint = vector(law.constraint, nv)
    for i in range(nv):
        now[_ACTUATOR, i] = actuator[i]
        now[_APPLIED, i] = smooth[i] - passive[i] + bias[i] - actuator[i]
        now[_DAMPING, i] = -damping[i] * qvel[i]
        now[_FRICTION, i] = friction[i]
        now[_CONTACT, i] = constraint[i] - friction[i]
        now[_SEAL, i] = 0.0
    if not law.walled:
        return
    n = world.q.size
    contact, seal = vector(law.contact_arm, n), vector(law.seal_arm, n)
    for i in range(n):
        _put_bore(now, world.first_dof + i, contact[i], seal[i], 0.0)
    contact, seal = vector(law.contact_shaft, law.bends), vector(law.seal_shaft, law.bends)
    for i in range(law.bends):
        _put_bore(now, world.first_dof + n + i, contact[i], seal[i], 0.0)
    contact, seal, drive = vector(law.contact_cannula, 3), vector(law.seal_cannula, 3), vector(law.drive, 3)
    stiffness, wall_damping = vector(law.wall_stiffness, 3), vector(law.wall_damping, 3)
    offset, velocity, spring = vector(law.offset, 3), vector(law.velocity, 3), vector(law.spring, nv)
    for k in range(3):
        i = law.cannula + k
        _put_bore(now, i, contact[k], seal[k], drive[k])
        now[_DAMPING, i] += wall_damping[k] * velocity[k]
        state.now_drive[k] = spring[i] + stiffness[k] * offset[k] + now[_DAMPING, i]


@compiled
def _put_bore(now: Array, i: int, contact: float, seal: float, drive: float) -> None:
    """Book the bore's forces on a degree of freedom as what they are."""
    now[_APPLIED, i] -= contact + seal + drive
    now[_CONTACT, i] += contact
    now[_SEAL, i] = seal


@compiled
def _add_work(law: Law, world: World, memory: Array, state: State) -> None:
    """Work over the step that led to this instant."""
    rows = _rows(memory, world.nv)
    for k in range(_FORCES):
        work = 0.0
        for i in range(world.nv):
            work += 0.5 * (rows[_LAST + k, i] + rows[_NOW + k, i]) * (law.h * rows[_BEFORE, i])
        state.works[k] += work
    if law.walled:
        offset = vector(law.offset, 3)
        for k in range(3):
            i, moved = law.cannula + k, offset[k] - state.last_offset[k]
            mean = 0.5 * (rows[_LAST + _DAMPING, i] + rows[_NOW + _DAMPING, i])
            state.works[_DAMPING] -= mean * moved
            state.works[_APPLIED] += 0.5 * (state.last_drive[k] + state.now_drive[k]) * moved


@compiled
def _read_energy(gains: Array, law: Law, world: World, memory: Array, state: State) -> None:
    """Energies at the instant before the step: M and positions are still its."""
    nv, rows, qvel = world.nv, _rows(memory, world.nv), vector(world.qvel, world.nv)
    own = _own(gains, world)
    for i in range(nv):
        rows[_MEAN, i] = 0.5 * (rows[_BEFORE, i] + own[i] * qvel[i])
    mean, momentum = rows[_MEAN], rows[_MOMENTUM]
    mj_mulM(world.mj_model, world.mj_data, momentum.ctypes.data, mean.ctypes.data)
    kinetic = potential = elastic = 0.0
    for i in range(nv):
        kinetic += momentum[i] * mean[i]
    weights, places = gains[LAW_SIZE + 2 * nv :], vector(world.xipos, 3 * world.nbody)
    for i in range(places.size):
        potential += weights[i] * places[i]
    springs, stretch = _springs(gains, world), memory[STATE_SIZE + _ROWS * nv :]
    for k in range(law.springs):
        elastic += springs[k, _STIFFNESS] * (stretch[k] * stretch[k])
    state.energy[0], state.energy[1], state.energy[2] = 0.5 * kinetic, potential, 0.5 * elastic
    if law.walled:
        offset, stiffness, spring = (
            vector(law.offset, 3),
            vector(law.wall_stiffness, 3),
            vector(law.spring, nv),
        )
        for k in range(3):
            state.energy[2] += (spring[law.cannula + k] + 0.5 * stiffness[k] * offset[k]) * offset[k]


@compiled
def fill_terms(gains: Array, world: World, memory: Array, out: Array) -> int:
    """The terms of `COLUMNS` (10,) [J], at the beginning of the last step."""
    law, state = gains[:LAW_SIZE].view(LAW)[0], memory[:STATE_SIZE].view(STATE)[0]
    works, change, work = state.works, 0.0, 0.0
    for k in range(3):
        out[k] = state.energy[k] - state.energy_at_start[k]
        change += out[k]
    for k in range(_FORCES):
        work += works[k]
    out[3], out[4], out[5] = works[_ACTUATOR], works[_APPLIED], -works[_DAMPING]
    out[6], out[7], out[8], out[9] = -works[_FRICTION] - works[_SEAL], works[_CONTACT], 0.0, change - work
    if law.walled and state.begun:
        stored = vector(law.stored, 2)
        out[8] = stored[0] + stored[1]
    for k in range(10):
        out[k] += 0.0  # no negative zeros
    return GOES_ON


def _roots(model: mujoco.MjModel) -> list[str]:
    """Of every body the name of the one that its tree hangs on."""
    return [str(model.body(root).name) for root in model.body_rootid]


class EnergyLedger:
    """Energies and works since `start`, in joules: `before_step`, `after_step` and `fill_terms`.

    kinetic, potential (gravity) and spring are changes since the start. The wall's spring is taken from its
    moving place of rest; what moves that place does `applied_work`, as does all of `qfrc_applied` and
    `xfrc_applied` that is not the bore's. `damping_loss` and `friction_loss` (dry friction of joints and
    seal) are positive when energy leaves. `contact_work` is what the bore's contact and all of MuJoCo's
    constraints but dry friction put in. `contact_stored`, for information, is the elastic energy of bore and
    seal: the part of contact_work and friction_loss that can come back.

    One of several arms in a model has a ledger of its own: the velocities of the others' joints are left out,
    and between their inertias there is no coupling.

    Dry friction of joints is one of MuJoCo's constraints, whose rows lie elsewhere at every step: only where
    there is some, it is looked up in Python.

    Args:
        scene: The compiled scene.
        data: Its data.
        bore: The port that acts in it; without it the bore's forces and the wall's motion are `applied_work`.

    Attributes:
        gains: Its numbers.
        memory: Its memory before the first step.
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

    def __init__(self, scene: Scene, data: mujoco.MjData, bore: Bore | None = None) -> None:
        model = scene.model
        self._model, self._data, self._friction = model, data, np.zeros(model.nv)
        self._entered = PythonPart(self._find_friction)
        mine = np.array([name.startswith(scene.prefix) for name in _roots(model)])
        springs = np.flatnonzero(np.array(model.jnt_stiffness) * mine[model.jnt_bodyid])
        places = model.jnt_qposadr[springs]
        table = np.column_stack(
            [places.astype(float), np.array(model.jnt_stiffness[springs]), model.qpos_spring[places]]
        )
        weights = -np.outer(np.array(model.body_mass) * mine, model.opt.gravity).ravel()
        own = mine[model.dof_bodyid].astype(float)
        damping = np.array(model.dof_damping).reshape(-1)
        self.gains = np.concatenate([np.zeros(LAW_SIZE), damping, own, weights, table.ravel()])
        self.memory = np.zeros(STATE_SIZE + _ROWS * model.nv + len(springs))
        law = laid_over(Law, self.gains)
        for name in ("actuator", "smooth", "passive", "constraint", "spring"):
            law[name] = getattr(data, f"qfrc_{name}").ctypes.data
        law.friction, law.entry[:] = self._friction.ctypes.data, self._entered.gains
        law.rubs, law.springs = bool(np.any(model.dof_frictionloss * own)), len(springs)
        law.h = model.opt.timestep
        if bore is None or scene.wall is None:
            return
        law.walled, law.cannula, law.bends = 1, bore.first_dof, bore.bends
        for name in (*(name for name in Push.SHAPES if name.startswith(("contact", "seal"))), "stored"):
            law[name] = getattr(bore.acting, name).ctypes.data
        for name in ("drive", "offset", "velocity"):
            law[name] = getattr(bore, name).ctypes.data
        law.wall_stiffness, law.wall_damping = bore.stiffness.ctypes.data, bore.damping.ctypes.data

    def _find_friction(self) -> None:
        data, friction = self._data, self._friction
        friction[:] = 0.0
        rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF
        np.add.at(friction, data.efc_id[rows], data.efc_force[rows])
