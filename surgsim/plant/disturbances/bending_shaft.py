"""A shaft that bends under what pushes on it, and that swings or settles."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

import mujoco
import numpy as np
from pydantic import Field, model_validator

from surgsim.array import Array
from surgsim.catalog import ADDED
from surgsim.compiled import compiled
from surgsim.errors import SurgsimError
from surgsim.models.bending import BEND_JOINTS, ElasticShaft, bend_shaft, shaft_diameter, tube_rigidity
from surgsim.models.build import Scene
from surgsim.models.config import WallConfig
from surgsim.plant.bore import FUNNEL_LENGTH_M
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig
from surgsim.plant.disturbances.settling import settle_cannula
from surgsim.plant.shaft import bend_joints, bend_stiffness, lateral_masses, piece_lengths
from surgsim.tick.arrays import World
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import centre_of_mass, push_at

Diameter = Annotated[float, Field(gt=0.0, le=0.02)]
_SAG_TURNS, _SAG_RAD = 30, 1e-12
_STABLE = 3.0
"""Most of (k h² + 2 b h) / m, whose limit of stability is 4."""
_RESOLVED = 1.0
"""Most of the first mode's w h: the trapezoidal rule slows it by (w h)² / 12."""
_STEPS = 2.0
"""Fewest timesteps of the time in which a shaft settles."""
GRAVITY, STIFF, PIECES = slice(0, 3), 3, 4
"""Gains: g (3,) [m/s²], the body that bears the mass of all pieces, then body and mass [kg] of each."""


@compiled
def hang(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Let the weight of every piece act where it is, and take it off the stiff part, which bears it already.

    The two are equal and at one point, so that only the joints between them feel them.
    """
    weight, against, stiff = scratch(3), scratch(3), int(gains[STIFF])
    for k in range(PIECES, gains.size, 2):
        body = int(gains[k])
        for i in range(3):
            weight[i] = gains[k + 1] * gains[i]
            against[i] = -weight[i]
        place = centre_of_mass(world, body)
        push_at(world, body, place, weight)
        push_at(world, stiff, place, against)
    return GOES_ON


class BendingShaftConfig(DisturbanceConfig):
    """The shaft is an elastic tube, clamped at its entry; the controller's model has a rigid one.

    The defaults are a tube of steel of 8/6 mm: 1.29 N/mm at the tip of the default shaft. Its inner diameter
    and its damping are assumed.

    Attributes:
        level: `dynamic`: the shaft swings by its own mass. `static`: it goes to the shape that it would have
            at rest under what presses on it now, its own weight included, and does not swing.
        outer_diameter_m: Of the tube [m]; null: the instrument's.
        inner_diameter_m: Of the tube [m]; 0: a rod.
        young_pa: Young's modulus: 200e9 of steel, 45e9 of a glass-fibre composite [Pa].
        damping_ratio: Of the shaft's first mode, its entry held; `dynamic` alone.
        settling_s: Each of the two time constants with which it goes to its shape; `static` alone [s].
    """

    type: Literal["bending_shaft"] = "bending_shaft"
    level: Annotated[Literal["dynamic", "static"], ADDED] = "dynamic"
    outer_diameter_m: Diameter | None = None
    inner_diameter_m: Annotated[float, Field(ge=0.0, le=0.02)] = 0.006
    young_pa: Annotated[float, Field(ge=1e8, le=1e13)] = 200e9
    damping_ratio: Annotated[float, Field(ge=0.0, le=1.0)] = 0.01
    settling_s: Annotated[Annotated[float, Field(gt=0.0, le=0.1)], ADDED] = 0.005

    @model_validator(mode="after")
    def _is_a_tube(self) -> Self:
        if self.outer_diameter_m is not None:
            self.rigidity(self.outer_diameter_m)
        idle, level = ("damping_ratio", "dynamic") if self.is_static else ("settling_s", "static")
        if getattr(self, idle) != type(self).model_fields[idle].default:
            raise ValueError(f"bending_shaft: {idle} is of a shaft with `level: {level}`")
        return self

    @property
    def is_static(self) -> bool:
        """Whether the shaft does not swing."""
        return self.level == "static"

    def rigidity(self, outer_m: float) -> float:
        """E I of a tube of that outer diameter [N m²].

        Raises:
            ValueError: If it is not thicker than its inner diameter.
        """
        if outer_m <= self.inner_diameter_m:
            raise ValueError(
                f"bending_shaft: inner_diameter_m {self.inner_diameter_m:g} must be below the outer one, "
                f"{outer_m:g}"
            )
        return tube_rigidity(outer_m, self.inner_diameter_m, self.young_pa)

    def build(self, rng: np.random.Generator) -> "BendingShaft":
        """The disturbance."""
        return BendingShaft(self)


class BendingShaft(Disturbance):
    """Puts a chain of pieces on springs in the place of the rigid shaft: `surgsim.models.bending`.

    What is true follows the bent shaft: the tip, the forces on it, the shaft in the bore, and its distance
    from the trocar. The run begins with the shaft at rest under its own weight. Forbidden contacts are looked
    for along the straight shaft.
    """

    adds_joints = len(BEND_JOINTS)

    def __init__(self, config: BendingShaftConfig) -> None:
        self._c = config
        self._masses = np.zeros(0)
        self.kernels: Mapping[str, Any] = {"push": hang} if config.is_static else {}

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Split the shaft; refuse a timestep that does not resolve how it moves.

        Raises:
            SurgsimError: With what the timestep must be at most; if there is no shaft that could bend.
        """
        c, h = self._c, float(spec.option.timestep)
        settling = c.settling_s if c.is_static else None
        if settling is not None and settling < _STEPS * h:
            raise SurgsimError(
                f"disturbance 'bending_shaft': settling_s {settling:g} must be at least {_STEPS:g} timesteps "
                f"of {h:g} s"
            )
        try:
            rigidity = c.rigidity(shaft_diameter(spec) if c.outer_diameter_m is None else c.outer_diameter_m)
            shaft = ElasticShaft(rigidity=rigidity, damping_ratio=c.damping_ratio, settling_s=settling)
            w, self._masses = bend_shaft(spec, shaft)
        except ValueError as error:
            raise SurgsimError(str(error)) from error
        if not c.is_static and w * h > _RESOLVED:
            raise SurgsimError(
                f"disturbance 'bending_shaft': the shaft swings at {w / (2.0 * np.pi):.3g} Hz, which needs a "
                f"timestep_s of at most {_RESOLVED / w:.2g}, not {h:g}"
            )

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Find the pieces; refuse a timestep that is too long for the light shaft's contact with the cannula.

        Raises:
            SurgsimError: With a timestep that is short enough.
        """
        self.gains = _weights(scene, self._masses)
        h = longest = float(scene.model.opt.timestep)
        while scene.wall is not None and _contact_ratio(scene, scene.wall, longest) > _STABLE:
            longest *= 0.5
        if longest < h:
            raise SurgsimError(
                f"disturbance 'bending_shaft': the shaft in the wall's bore needs a shorter timestep_s than "
                f"{h:g}: {longest:g} will do{', or a longer settling_s' if self._c.is_static else ''}"
            )

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Let the shaft be at rest under its weight, and the cannula around it.

        Raises:
            SurgsimError: If there is no such rest: it is too soft to bear itself.
        """
        model, first = scene.model, int(scene.dof_ids[-1]) + 1
        self.gains[GRAVITY] = model.opt.gravity
        at = slice(first, first + bend_joints(scene))
        places = [int(scene.parts.joint(name).qposadr[0]) for name in BEND_JOINTS]
        stiffness = bend_stiffness(scene)
        posed = mujoco.MjData(model)
        posed.qpos[:] = data.qpos
        posed.qpos[places] = 0.0
        for _ in range(_SAG_TURNS):
            mujoco.mj_fwdPosition(model, posed)
            mujoco.mj_fwdVelocity(model, posed)
            torque = posed.qfrc_passive - posed.qfrc_bias
            if self._c.is_static:
                _add_weights(self.gains, model, posed, torque)
            missing = torque[at] / stiffness
            posed.qpos[places] += missing
        if not np.abs(missing).max() < _SAG_RAD:
            raise SurgsimError("disturbance 'bending_shaft': the shaft is too soft to bear its own weight")
        data.qpos[places] = posed.qpos[places]
        settle_cannula(scene, data)


def _weights(scene: Scene, masses: Array) -> Array:
    """Gains of `hang` for pieces of those masses (k,) [kg], as yet without gravity."""
    parts = scene.parts
    pieces = [(int(parts.body(f"shaft{k}").id), mass) for k, mass in enumerate(masses, start=1)]
    return np.array([0.0, 0.0, 0.0, int(parts.body("instrument").id), *np.ravel(pieces)])


def _add_weights(gains: Array, model: mujoco.MjModel, data: mujoco.MjData, torque: Array) -> None:
    """Add what `hang` does to the joints' torques (nv,) [N m]."""
    for body, mass in gains[PIECES:].reshape(-1, 2):
        for on, sign in ((int(body), 1.0), (int(gains[STIFF]), -1.0)):
            weight = sign * mass * gains[GRAVITY]
            mujoco.mj_applyFT(model, data, weight, np.zeros(3), data.xipos[int(body)], on, torque)


def _contact_ratio(scene: Scene, wall: WallConfig, h: float) -> float:
    """Largest (k h² + 2 b h) / m along the shaft where it fills the bore; explicit steps are stable below 4.

    k and b are the stiffness and the damping between the shaft of effective mass m_s and the cannula of mass
    m_c, 1/m = 1/m_s + 1/m_c, and h is the timestep.
    """
    length = float(np.sum(piece_lengths(scene)))
    places = np.linspace(0.1 * length, length - FUNNEL_LENGTH_M, 50)
    mobility = 1.0 / lateral_masses(scene, places, h).min() + 1.0 / wall.mass_kg
    k = wall.lateral_stiffness_n_per_m + wall.contact_stiffness_n_per_m
    return float((k * h**2 + 2.0 * wall.contact_damping_n_s_per_m * h) * mobility)
