"""A shaft that bends under what pushes on it, and that swings."""

from typing import Annotated, Literal, Self

import mujoco
import numpy as np
from pydantic import Field, model_validator

from surgsim.errors import SurgsimError
from surgsim.models.bending import BEND_JOINTS, ElasticShaft, bend_shaft, shaft_diameter, tube_rigidity
from surgsim.models.build import Scene
from surgsim.models.config import WallConfig
from surgsim.plant.bore import FUNNEL_LENGTH_M
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig
from surgsim.plant.disturbances.settling import settle_cannula
from surgsim.plant.shaft import bend_joints, lateral_masses, piece_lengths

Diameter = Annotated[float, Field(gt=0.0, le=0.02)]
_SAG_TURNS, _SAG_RAD = 30, 1e-12
_STABLE = 3.0
"""Most of (k h² + 2 b h) / m, whose limit of stability is 4."""
_RESOLVED = 1.0
"""Most of the first mode's w h: the trapezoidal rule slows it by (w h)² / 12."""


class BendingShaftConfig(DisturbanceConfig):
    """The shaft is an elastic tube, clamped at its entry; the controller's model has a rigid one.

    The defaults are a tube of steel of 8/6 mm: 1.29 N/mm at the tip of the default shaft. Its inner diameter
    and its damping are assumed.

    Attributes:
        outer_diameter_m: Of the tube [m]; null: the instrument's.
        inner_diameter_m: Of the tube [m]; 0: a rod.
        young_pa: Young's modulus: 200e9 of steel, 45e9 of a glass-fibre composite [Pa].
        damping_ratio: Of the shaft's first mode, its entry held.
    """

    type: Literal["bending_shaft"] = "bending_shaft"
    outer_diameter_m: Diameter | None = None
    inner_diameter_m: Annotated[float, Field(ge=0.0, le=0.02)] = 0.006
    young_pa: Annotated[float, Field(ge=1e8, le=1e13)] = 200e9
    damping_ratio: Annotated[float, Field(ge=0.0, le=1.0)] = 0.01

    @model_validator(mode="after")
    def _is_a_tube(self) -> Self:
        if self.outer_diameter_m is not None:
            self.rigidity(self.outer_diameter_m)
        return self

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

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Split the shaft; refuse a timestep that does not resolve its swinging.

        Raises:
            SurgsimError: With what the timestep must be at most; if there is no shaft that could bend.
        """
        outer, h = self._c.outer_diameter_m, float(spec.option.timestep)
        try:
            rigidity = self._c.rigidity(shaft_diameter(spec) if outer is None else outer)
            w = bend_shaft(spec, ElasticShaft(rigidity=rigidity, damping_ratio=self._c.damping_ratio))
        except ValueError as error:
            raise SurgsimError(str(error)) from error
        if w * h > _RESOLVED:
            raise SurgsimError(
                f"disturbance 'bending_shaft': the shaft swings at {w / (2.0 * np.pi):.3g} Hz, which needs a "
                f"timestep_s of at most {_RESOLVED / w:.2g}, not {h:g}"
            )

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Refuse a timestep that is too long for the contact of the light shaft with the cannula.

        Raises:
            SurgsimError: With a timestep that is short enough.
        """
        h = longest = float(scene.model.opt.timestep)
        while scene.wall is not None and _contact_ratio(scene, scene.wall, longest) > _STABLE:
            longest *= 0.5
        if longest < h:
            raise SurgsimError(
                f"disturbance 'bending_shaft': the shaft in the wall's bore needs a shorter timestep_s than "
                f"{h:g}: {longest:g} will do"
            )

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Let the shaft be at rest under its weight, and the cannula around it.

        Raises:
            SurgsimError: If there is no such rest: it is too soft to bear itself.
        """
        model, first = scene.model, int(scene.dof_ids[-1]) + 1
        at = slice(first, first + bend_joints(scene))
        places = [int(scene.parts.joint(name).qposadr[0]) for name in BEND_JOINTS]
        stiffness = np.array([np.ravel(scene.parts.joint(name).stiffness)[0] for name in BEND_JOINTS])
        posed = mujoco.MjData(model)
        posed.qpos[:] = data.qpos
        posed.qpos[places] = 0.0
        for _ in range(_SAG_TURNS):
            mujoco.mj_fwdPosition(model, posed)
            mujoco.mj_fwdVelocity(model, posed)
            missing = (posed.qfrc_passive - posed.qfrc_bias)[at] / stiffness
            posed.qpos[places] += missing
        if not np.abs(missing).max() < _SAG_RAD:
            raise SurgsimError("disturbance 'bending_shaft': the shaft is too soft to bear its own weight")
        data.qpos[places] = posed.qpos[places]
        settle_cannula(scene, data)


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
