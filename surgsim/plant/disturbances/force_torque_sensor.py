"""A force-torque sensor between flange and instrument."""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import mujoco
import numpy as np
from pydantic import NonNegativeFloat

from surgsim.array import Array
from surgsim.columns import vector
from surgsim.compiled import compiled
from surgsim.models.build import Scene, body_at_flange
from surgsim.plant.disturbances.base import SENSOR, Disturbance, DisturbanceConfig, drawn_row
from surgsim.plant.disturbances.instrument_tracker import straight_tip
from surgsim.plant.part import BLOCK_TICKS
from surgsim.tick.algebra import cross
from surgsim.tick.arrays import World
from surgsim.tick.mujoco_calls import mj_rnePostConstraint
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import doubles, site_place, site_turn

FORCE_STD, MOMENT_STD, BODY, ROOT = range(4)
"""Gains: standard deviations [N] and [N m], bodies of the instrument and of the arm's root; then the bias."""
BIAS, WEIGHT, CENTRE, TIP = (slice(4 + 6 * k, 10 + 6 * k) for k in range(4))
"""Bias (6,) [N, N m], weight (3,) [N]; centre of mass and tip (3,) [m] in the frame of the shaft's entry."""
OWN, WHOLE, NOISE = slice(0, 6), slice(6, 12), 12
"""Memory: force and moment (6,) of the last step, and with those of the wall; then the noise's rows (6,)."""


@compiled
def _placed(world: World, offset: Array, out: Array) -> None:
    """Fill the place (3,) [m] of a point that the frame of the shaft's entry carries at `offset` (3,) [m]."""
    entry, axes = site_place(world, world.entry), site_turn(world, world.entry)
    for i in range(3):
        out[i] = entry[i]
        for k in range(3):
            out[i] += axes[3 * i + k] * offset[k]


@compiled
def feel(gains: Array, world: World, memory: Array, out: Array) -> int:
    """What the surroundings do to the instrument in this physics step, from what the flange does to it.

        F = - F_flange - m g,   M = - M_flange - (c - p_T) x m g

    about the tip p_T of a straight shaft. The acceleration of the instrument is not known to the sensor: F
    and M hold - m a too.
    """
    mj_rnePostConstraint(world.mj_model, world.mj_data)
    held = doubles(world.cfrc_int, world.nbody, 6)[int(gains[BODY])]  # torque, then force
    about = doubles(world.subtree_com, world.nbody, 3)[int(gains[ROOT])]
    tip, centre, arm = scratch(3), scratch(3), scratch(3)
    from_flange, from_weight = scratch(3), scratch(3)
    _placed(world, gains[TIP], tip)
    _placed(world, gains[CENTRE], centre)
    weight = gains[WEIGHT]
    for i in range(3):
        arm[i] = about[i] - tip[i]
        centre[i] -= tip[i]
    cross(arm, held[3:], from_flange)
    cross(centre, weight[:3], from_weight)
    own = memory[OWN]
    for i in range(3):
        own[i] = -held[3 + i] - weight[i]
        own[3 + i] = -held[i] - from_flange[i] - from_weight[i]
    return GOES_ON


@compiled
def report(gains: Array, world: World, memory: Array, out: Array) -> int:
    """What is measured, f_S = F + b_f + s_f n and m_S = M + b_m + s_m n, with independent normal n."""
    true, bias, noise = memory[WHOLE], gains[BIAS], NOISE + 6 * drawn_row(world.tick)
    world.has_wrench = 1
    for i in range(3):
        world.f_S_m[i] = true[i] + bias[i] + gains[FORCE_STD] * memory[noise + i]
        world.m_S_m[i] = true[3 + i] + bias[3 + i] + gains[MOMENT_STD] * memory[noise + 3 + i]
    return GOES_ON


@compiled
def tell(gains: Array, world: World, memory: Array, out: Array) -> int:
    """The columns: the true force and moment, with those of the wall added.

        F - f_C,   M - (p_WC - p_T) x f_C

    f_C is the force of the shaft on the wall, which MuJoCo knows as joint torques only.
    """
    true = memory[WHOLE]
    true[:] = memory[OWN]
    if world.walled:
        arm, moment = scratch(3), scratch(3)
        _placed(world, gains[TIP], arm)
        for i in range(3):
            arm[i] = world.p_WC[i] - arm[i]
        cross(arm, world.f_C, moment)
        for i in range(3):
            true[i] -= world.f_C[i]
            true[3 + i] -= moment[i]
    out[:6] = true
    return GOES_ON


class ForceTorqueSensorConfig(DisturbanceConfig):
    """A force-torque sensor at the flange: it measures what the surroundings do to the instrument.

    Without this part the controller has no such sensor. The instrument's weight is taken off, as after a
    calibration; what its acceleration takes is not. A payload at the flange is not behind the sensor.

    Assumed: noise of a sensor for 100 N and 5 N m, and no bias, which a tare takes off.

    Attributes:
        force_std_n: White noise of each component of the force [N].
        moment_std_nm: White noise of each component of the moment [N m].
        force_bias_std_n: Standard deviation of each component of a constant bias, drawn by the seed [N].
        moment_bias_std_nm: The same of the moment [N m].
    """

    measures_flange: ClassVar[bool] = True

    type: Literal["force_torque_sensor"] = "force_torque_sensor"
    force_std_n: NonNegativeFloat = 0.05
    moment_std_nm: NonNegativeFloat = 0.002
    force_bias_std_n: NonNegativeFloat = 0.0
    moment_bias_std_nm: NonNegativeFloat = 0.0

    def build(self, rng: np.random.Generator) -> "ForceTorqueSensor":
        """The sensor, its bias drawn."""
        return ForceTorqueSensor(self, rng)


class ForceTorqueSensor(Disturbance):
    """Measures at every control tick the last physics step: `feel`, `report`."""

    rank = SENSOR
    columns = (vector("flange_force", "n"), vector("flange_moment", "nm"))
    kernels: Mapping[str, Any] = {"after_step": feel, "sense": report, "values": tell}

    def __init__(self, config: ForceTorqueSensorConfig, rng: np.random.Generator) -> None:
        self._c = config
        self._bias = rng.standard_normal(6) * np.repeat(
            (config.force_bias_std_n, config.moment_bias_std_nm), 3
        )
        self._rng = np.random.default_rng(0)
        self._begins = True

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Weigh the instrument, and make room for the noise."""
        model, body = scene.model, body_at_flange(scene)
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        entry = scene.shaft_entry_site
        R_WE = data.site_xmat[entry].reshape(3, 3)
        centre = R_WE.T @ (data.subtree_com[body] - data.site_xpos[entry])
        weight = model.body_subtreemass[body] * model.opt.gravity
        rest = np.zeros(3)
        own = (self._c.force_std_n, self._c.moment_std_nm, body, int(model.body_rootid[body]))
        places = (weight, rest, centre, rest, straight_tip(scene)[:3], rest)
        self.gains = np.concatenate((own, self._bias, *places))
        self.memory = np.zeros(NOISE + 6 * (BLOCK_TICKS + 1))

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Draw from the beginning."""
        self._rng, self._begins = rng, True

    def refill(self, memory: Array) -> None:
        """Draw the noise of the coming ticks, at first that of the start too."""
        first = 0 if self._begins else 1
        rows = memory[NOISE:].reshape(-1, 6)
        rows[first:] = self._rng.standard_normal((BLOCK_TICKS + 1 - first, 6))
        self._begins = False
