"""The abdominal wall moves with the patient's breath."""

from typing import Annotated, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, model_validator

from surgsim.errors import SurgsimError
from surgsim.models.config import Vec3
from surgsim.plant.disturbances.base import Disturbance, DisturbanceConfig, Spread, spread_factor
from surgsim.plant.part import PortMotion
from surgsim.plant.state import State
from surgsim.spatial import unit

Array = NDArray[np.float64]


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
    """Moves the port along a line, with a smooth rise and a smooth fall a breath.

    Offset r(t) w(t) A d with the excursion A, the direction d and the smooth step

        s(x) = 10 x^3 - 15 x^4 + 6 x^5,   0 <= x <= 1

    as ramp r = s(t / ramp) and as both flanks of the wave: w = s(x / i) while x < i, then
    w = s((1 - x) / (1 - i)), with the phase x of the breath and the share i of inspiration. Position,
    velocity and acceleration are continuous, and the motion begins at rest. It is a function of time:
    there is nothing to reset.

    Several breaths add up, and each says or hides its own part: the position known is the true one less the
    offsets of the hidden, the velocity known the sum of the announced.
    """

    def __init__(self, config: BreathingConfig, excursion: Array, phase: float) -> None:
        self._c = config
        self._excursion = excursion
        self._phase = phase

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Refuse a scenario without a trocar."""
        refuse_without_port(spec, "breathing")

    def port_motion(self, t_s: float) -> PortMotion:
        """Offset of the port and its velocity at `t_s` [s]."""
        level, rate = self.level(t_s)
        return PortMotion(offset=level * self._excursion, velocity=rate * self._excursion)

    def level(self, t_s: float) -> tuple[float, float]:
        """Share of the excursion at `t_s` [s], and its rate [1/s]."""
        c = self._c
        x = (self._phase + t_s * c.rate_hz) % 1.0
        if x < c.inspiration_share:
            w, dw = _step(x / c.inspiration_share)
            dw *= c.rate_hz / c.inspiration_share
        else:
            w, dw = _step((1.0 - x) / (1.0 - c.inspiration_share))
            dw *= -c.rate_hz / (1.0 - c.inspiration_share)
        if t_s >= c.ramp_s:
            return w, dw
        r, dr = _step(t_s / c.ramp_s)
        return r * w, dr / c.ramp_s * w + r * dw

    def sense(self, state: State) -> State:
        """What the controller is told of the port."""
        if self._c.seen == "tracked":
            return state
        p_WC, v_WC = state.p_WC, state.v_WC
        level, rate = self.level(state.t_s)
        if self._c.seen == "announced":
            v_WC = v_WC + rate * self._excursion
        else:
            p_WC = p_WC - level * self._excursion
        return State(t_s=state.t_s, q=state.q, v=state.v, tau=state.tau, p_WC=p_WC, v_WC=v_WC, f_T=state.f_T)


def _step(x: float) -> tuple[float, float]:
    """Smooth step of `x` from 0 to 1, and its slope."""
    return x * x * x * (10.0 - x * (15.0 - 6.0 * x)), 30.0 * (x * (1.0 - x)) ** 2
