"""Joint friction that the controller's model does not have."""

from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field, NonNegativeFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import Surroundings
from surgsim.models.build import Scene, span
from surgsim.models.robot import joint_names
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig, Spread, copied, spread_factor


class JointFrictionConfig(DisturbanceConfig):
    """Coulomb, viscous and, if wanted, Stribeck friction of every joint.

    On real drives it is that of the links, in their bearings; the motors have their own (`robot.drive`).

    Attributes:
        coulomb_nm: Dry friction torque of each joint [N m].
        viscous_nm_s_per_rad: Viscous friction added to the model's own [N m s/rad].
        static_nm: Dry friction torque at rest, at least coulomb_nm [N m]; null: the same as in motion.
        stribeck_velocity_rad_per_s: Over which it falls from static to Coulomb friction [rad/s]. The
            default is assumed.
        spread: Relative spread of all torques over seeds, drawn for each joint.
    """

    type: Literal["joint_friction"] = "joint_friction"
    coulomb_nm: NonNegativeFloat = 0.5
    viscous_nm_s_per_rad: NonNegativeFloat = 0.0
    static_nm: NonNegativeFloat | None = None
    stribeck_velocity_rad_per_s: Annotated[float, Field(ge=0.001, le=10.0)] = 0.05

    spread: Spread = 0.0

    @model_validator(mode="after")
    def _static_is_more(self) -> "JointFrictionConfig":
        if self.static_nm is not None and not 0.0 < self.coulomb_nm <= self.static_nm:
            raise ValueError(
                f"joint_friction: static_nm {self.static_nm:g} must be at least coulomb_nm "
                f"{self.coulomb_nm:g}, and that above 0"
            )
        return self

    def check(self, scenario: Surroundings) -> None:
        """Refuse links of real drives that hold better at rest: that friction is in the motors."""
        if self.static_nm is not None and scenario.has_drives:
            raise ValueError(
                "joint_friction: static_nm is for ideal drives; on real ones motors have the friction that "
                "is greater at rest: give robot.drive.static_nm"
            )

    def build(self, rng: np.random.Generator) -> "JointFriction | StribeckFriction":
        """The disturbance, which draws each joint's friction."""
        dry = JointFriction(self, rng)
        return dry if self.static_nm is None else StribeckFriction(self, dry)


class JointFriction(Disturbance):
    """MuJoCo's dry joint friction (`frictionloss`, a constraint) and added damping.

    With MuJoCo's default constraint parameters a joint creeps at 3 mrad/s under 80 % of its friction torque;
    the ones here let it stick (0.3 urad/s). Several add up.
    """

    def __init__(self, config: JointFrictionConfig, rng: np.random.Generator) -> None:
        self._c = config
        self._rng = rng

    def factors(self, n: int) -> Array:
        """What each joint's torques are over the given ones (n,)."""
        return spread_factor(copied(self._rng), self._c.spread, n)

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Add to the joints' friction loss and damping."""
        joints = joint_names(spec)
        for name, factor in zip(joints, self.factors(len(joints)), strict=True):
            joint = spec.joint(name)
            joint.frictionloss += factor * self._c.coulomb_nm
            joint.solimp_friction, joint.solref_friction = _STIFF_IMPEDANCE, _STIFF_REFERENCE
            damping = np.array(joint.damping, dtype=float)
            damping[0] += factor * self._c.viscous_nm_s_per_rad
            joint.damping = damping


class StribeckFriction(Disturbance):
    """Dry friction that is greater at rest than in motion.

        F(v) = F_c + (F_s - F_c) exp(-(v / v_s)^2)      Coulomb F_c, static F_s, Stribeck velocity v_s

    bounds the force of MuJoCo's friction constraint, set in every step for the joint's velocity in it. The
    force itself stays the constraint's: it brings the joint to rest or opposes its motion, so that friction
    sticks below F_s and puts in no energy, however F changes.

    Source: Stribeck friction with the Gaussian model, e.g. Armstrong-Hélouvry, Dupont and Canudas de Wit,
    Automatica 30:1083 (1994).

    Args:
        config: Torques and velocity.
        dry: Coulomb and viscous friction.
    """

    def __init__(self, config: JointFrictionConfig, dry: JointFriction) -> None:
        self._dry = dry
        self._over = (config.static_nm or config.coulomb_nm) - config.coulomb_nm
        self._velocity = config.stribeck_velocity_rad_per_s
        self._surplus, self._qvel = np.zeros(0), np.zeros(0)
        self._rows = slice(0, 0)

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Add Coulomb and viscous friction."""
        self._dry.modify(spec)

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Find the arm's rows among the friction constraints, which follow the equality constraints."""
        n = scene.dof_ids.size
        self._surplus = self._dry.factors(n) * self._over
        with_friction = np.flatnonzero(scene.model.dof_frictionloss > 0.0)
        first = int(np.searchsorted(with_friction, scene.dof_ids[0]))
        if not np.array_equal(with_friction[first : first + n], scene.dof_ids):
            raise ValueError("the arm's joints have no friction constraint each")
        self._rows = slice(first, first + n)
        self._qvel = data.qvel[span(scene.dof_ids)]

    def push(self, t_s: float, scene: Scene, data: mujoco.MjData) -> None:
        """Add F(v) - F_c to the bounds that `mj_step1` has set."""
        ratio = self._qvel / self._velocity
        first = int(data.ne)
        rows = slice(first + self._rows.start, first + self._rows.stop)
        bounds = data.efc_frictionloss
        bounds[rows] += self._surplus * np.exp(-ratio * ratio)
        if data.nisland:  # the solver then reads a copy in its own order
            data.iefc_frictionloss[data.map_efc2iefc[rows]] = bounds[rows]


_STIFF_IMPEDANCE = (0.9999, 0.9999, 0.001, 0.5, 2.0)
_STIFF_REFERENCE = (0.002, 1.0)
