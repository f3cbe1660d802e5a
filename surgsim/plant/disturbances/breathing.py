"""The abdominal wall moves with the patient's breath."""

from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.errors import SurgsimError
from surgsim.models.config import Vec3
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig, Spread, spread_factor
from surgsim.spatial import unit
from surgsim.tick.arrays import World
from surgsim.tick.status import GOES_ON

EXCURSION, PHASE, RATE, INSPIRATION, RAMP = 0, 3, 4, 5, 6
"""Gains: excursion A d (3,) [m], phase at the start, breaths [Hz], share of inspiration, ramp [s]."""


@compiled
def breath(gains: Array, t_s: float) -> tuple[float, float]:
    """Share r w of the excursion at `t_s` [s], and its rate [1/s].

    With the smooth step

        s(x) = 10 x^3 - 15 x^4 + 6 x^5,   0 <= x <= 1

    the ramp is r = s(t / ramp), and both flanks of the wave are w = s(x / i) while x < i, then
    w = s((1 - x) / (1 - i)), with the phase x of the breath and the share i of inspiration. Position,
    velocity and acceleration are continuous, and the motion begins at rest.
    """
    rate, inspiration = gains[RATE], gains[INSPIRATION]
    x = (gains[PHASE] + t_s * rate) % 1.0
    if x < inspiration:
        w, dw = _step(x / inspiration)
        dw *= rate / inspiration
    else:
        w, dw = _step((1.0 - x) / (1.0 - inspiration))
        dw *= -rate / (1.0 - inspiration)
    if t_s >= gains[RAMP]:
        return w, dw
    r, dr = _step(t_s / gains[RAMP])
    return r * w, dr / gains[RAMP] * w + r * dw


@compiled
def _step(x: float) -> tuple[float, float]:
    """Smooth step of `x` from 0 to 1, and its slope."""
    rest = x * (1.0 - x)
    return x * x * x * (10.0 - x * (15.0 - 6.0 * x)), 30.0 * (rest * rest)


@compiled
def move_port(gains: Array, world: World, memory: Array, out: Array) -> int:
    """The port moves: offset r w A d, and its velocity."""
    level, rate = breath(gains, world.step_s)
    for i in range(3):
        world.port_offset[i] += level * gains[EXCURSION + i]
        world.port_velocity[i] += rate * gains[EXCURSION + i]
    return GOES_ON


@compiled
def announce(gains: Array, world: World, memory: Array, out: Array) -> int:
    """The controller is told the velocity."""
    _, rate = breath(gains, world.t_s)
    for i in range(3):
        world.v_WC_m[i] += rate * gains[EXCURSION + i]
    return GOES_ON


@compiled
def hide(gains: Array, world: World, memory: Array, out: Array) -> int:
    """The controller is told the position without this motion."""
    level, _ = breath(gains, world.t_s)
    for i in range(3):
        world.p_WC_m[i] -= level * gains[EXCURSION + i]
    return GOES_ON


_TOLD = {"tracked": {}, "announced": {"sense": announce}, "hidden": {"sense": hide}}


class BreathingConfig(DisturbanceConfig):
    """The port moves with the breath: in, out, in, along one direction.

    Rate and the share of inspiration are those of ventilation under pneumoperitoneum: 12 breaths a minute,
    inspiration to expiration 1 : 1.5 (Diagnostics 14:2375, 2024). Excursion and direction are assumed: mostly
    normal to the skin, with 45 % of it across.

    Attributes:
        amplitude_m: Excursion from end of expiration, the configured place, to end of inspiration: peak to
            peak [m].
        direction: Towards which the port moves with inspiration, world frame; any length but zero. What is
            along the shaft does not disturb the remote centre of motion.
        rate_hz: Breaths per second [Hz].
        inspiration_share: Of inspiration in a breath.
        ramp_s: Over which the motion grows from rest to its full excursion [s].
        random_phase: Whether the point of the breath at the start is drawn; else it is the end of expiration.
        seen: What the controller is told: `announced`: position and velocity; `tracked`: the position;
            `hidden`: the port as if it did not move.
        spread: Relative spread of the excursion over seeds.
    """

    type: Literal["breathing"] = "breathing"
    amplitude_m: Annotated[float, Field(gt=0.0, le=0.1)] = 0.005
    direction: Vec3 = (0.5, 0.0, 1.0)
    rate_hz: Annotated[float, Field(gt=0.0, le=5.0)] = 0.2
    inspiration_share: Annotated[float, Field(ge=0.1, le=0.9)] = 0.4
    ramp_s: PositiveFloat = 1.0
    random_phase: bool = False
    seen: Literal["announced", "tracked", "hidden"] = "tracked"
    spread: Spread = 0.0

    @model_validator(mode="after")
    def _is_a_direction(self) -> "BreathingConfig":
        if not any(self.direction):
            raise ValueError("breathing: direction must not be zero")
        return self

    def build(self, rng: np.random.Generator) -> "Breathing":
        """The disturbance, excursion and phase drawn."""
        excursion = self.amplitude_m * float(spread_factor(rng, self.spread)[0])
        phase = float(rng.uniform()) if self.random_phase else 0.0
        return Breathing(self, excursion * unit(np.array(self.direction)), phase)


def refuse_without_port(spec: mujoco.MjSpec, name: str) -> None:
    """Refuse a scene without a trocar.

    Raises:
        SurgsimError: If there is none.
    """
    if all(body.name != "port" for body in spec.bodies):
        raise SurgsimError(f"disturbance '{name}' needs a trocar, and the scenario has none")


class Breathing(Disturbance):
    """Moves the port along a line, with a smooth rise and a smooth fall a breath: `breath`.

    It is a function of time: there is nothing to reset. Several breaths add up, and each says or hides its
    own part: the position known is the true one less the offsets of the hidden, the velocity known the sum of
    the announced.
    """

    def __init__(self, config: BreathingConfig, excursion: Array, phase: float) -> None:
        self.kernels = {"port_motion": move_port, **_TOLD[config.seen]}
        self.gains = np.array([*excursion, phase, config.rate_hz, config.inspiration_share, config.ramp_s])

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Refuse a scenario without a trocar."""
        refuse_without_port(spec, "breathing")
