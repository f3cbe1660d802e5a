"""Sensors that are noisy, and joint positions in whole counts of the encoder."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import mujoco
import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import Surroundings
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import (
    SENSOR,
    Disturbance,
    DisturbanceConfig,
    check_rate,
    drawn_row,
    frame_at,
)
from surgsim.plant.part import BLOCK_TICKS
from surgsim.tick.arrays import World
from surgsim.tick.status import GOES_ON

Q_STD, V_STD, TAU_STD, PORT_STD, TIP_STD, RESOLUTION, KEEP, RATE = range(8)
"""Gains: s_q, s_v, s_t, s_p, s_f; r (0: no steps); a (-1: no differences); tracker (0: always) [Hz]."""
FRAME, PORT, NOISE = 0, 1, 4
"""Memory: the tracker's measurements so far, the last (3,) [m], the noise's rows; then q_m and v_m."""


@compiled
def measure(gains: Array, world: World, memory: Array, out: Array) -> int:
    """What the sensors say: noise, encoder steps, differences and the tracker's hold.

    Measured from true, at tick k with independent normal n:

        q_m = r round((q + s_q n) / r),   r = 2 pi / 2^bits        (no rounding without bits)
        v_m = v + s_v n,   or   v_m = a v_m,k-1 + (1 - a) (q_m - q_m,k-1) / h,   a = exp(-2 pi f h)
        tau_m = tau + s_t n,   p_m = p_WC + s_p n,   f_m = f_T + s_f n

    with the control period h and the cut-off f. The arm is at rest before the first tick.
    """
    n = world.q_m.size
    width = 3 * n + 6
    row = drawn_row(world.tick)
    noise = memory[NOISE + row * width : NOISE + (row + 1) * width]
    last = memory[NOISE + (BLOCK_TICKS + 1) * width :]
    step, keep = gains[RESOLUTION], gains[KEEP]
    for i in range(n):
        q = world.q_m[i] + gains[Q_STD] * noise[i]
        if step > 0.0:
            q = step * np.rint(q / step)
        if keep < 0.0:
            world.v_m[i] += gains[V_STD] * noise[n + i]
        else:
            if world.tick == 0:
                last[n + i] = 0.0
            else:
                last[n + i] = keep * last[n + i] + (1.0 - keep) / world.dt_s * (q - last[i])
            world.v_m[i] = last[n + i]
        last[i] = world.q_m[i] = q
        world.tau_m[i] += gains[TAU_STD] * noise[2 * n + i]
    for i in range(3):
        world.p_WC_m[i] += gains[PORT_STD] * noise[3 * n + i]
        world.f_T_m[i] += gains[TIP_STD] * noise[3 * n + 3 + i]
    if gains[RATE] > 0.0:
        _track(gains, world, memory)
    return GOES_ON


@compiled
def _track(gains: Array, world: World, memory: Array) -> None:
    """The port's position, measured at the tracker's rate."""
    frame = frame_at(world.t_s, gains[RATE])
    for i in range(3):
        if frame != memory[FRAME]:
            memory[PORT + i] = world.p_WC_m[i]
        world.p_WC_m[i] = memory[PORT + i]
    memory[FRAME] = frame


class SensorNoiseConfig(DisturbanceConfig):
    """White noise of all sensors, encoder steps, and a tracker of the port that measures now and then.

    Assumed where no source is named. A light-weight arm's absolute joint sensor resolves 0.01 deg, 1.7e-4 rad
    (DLR); the default is a twentieth of it, as joint positions are taken from the motor's sensor before the
    gear. An optical tracker of the port has a static error of 0.045 mm RMS in space (Polaris Vega,
    doi 10.1186/s13014-021-01804-7), so a port_std_m of 2.6e-5; the default is a port that is known,
    not tracked.

    Attributes:
        position_std_rad: Standard deviation of joint positions [rad].
        position_bits: Encoder counts a turn as a power of two; null: no steps.
        velocity: `measured` is the true velocity with noise; `differentiated` is the backward difference of
            the measured positions through a first-order low-pass.
        velocity_std_rad_per_s: Standard deviation of measured velocities [rad/s]; without effect on
            differences.
        velocity_cutoff_hz: Of the low-pass [Hz]; without effect on measured velocities. The default is
            libfranka's.
        torque_std_nm: Standard deviation of joint torques [N m].
        port_std_m: Standard deviation of each coordinate of the port's position [m].
        port_rate_hz: Measurements of the port per second, the last one holds; null: one a control tick [Hz].
        tip_force_std_n: Standard deviation of each component of the force on the tip [N].
    """

    type: Literal["sensor_noise"] = "sensor_noise"
    position_std_rad: NonNegativeFloat = 1e-5
    position_bits: Annotated[int, Field(ge=8, le=32)] | None = None
    velocity: Literal["measured", "differentiated"] = "measured"
    velocity_std_rad_per_s: NonNegativeFloat = 1e-3
    velocity_cutoff_hz: PositiveFloat = 100.0
    torque_std_nm: NonNegativeFloat = 0.05
    port_std_m: NonNegativeFloat = 0.0
    port_rate_hz: PositiveFloat | None = None
    tip_force_std_n: NonNegativeFloat = 0.05

    def check(self, scenario: Surroundings) -> None:
        """Refuse a tracker or a low-pass faster than the control ticks can follow."""
        if self.port_rate_hz is not None:
            check_rate("sensor_noise", "port_rate_hz", self.port_rate_hz, scenario.control_period_s)
        if self.velocity == "differentiated" and self.velocity_cutoff_hz * scenario.control_period_s > 0.5:
            raise ValueError(
                f"sensor_noise: velocity_cutoff_hz {self.velocity_cutoff_hz:g} must be at most half the "
                f"control rate, {0.5 / scenario.control_period_s:g} Hz"
            )

    def build(self, rng: np.random.Generator) -> "SensorNoise":
        """The disturbance."""
        return SensorNoise(self)


class SensorNoise(Disturbance):
    """Noise, encoder steps, differences and the tracker's hold.

    Source: of the joint sensor, DLR's description of its light-weight robot; of the cut-off, libfranka's
    `kDefaultCutoffFrequency`.
    """

    rank = SENSOR
    kernels: Mapping[str, Any] = {"sense": measure}

    def __init__(self, config: SensorNoiseConfig) -> None:
        self._c = config
        self._rng = np.random.default_rng(0)
        self._begins, self._width = True, 0

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Settle the gains, and make room for the noise."""
        c, n = self._c, len(scene.dof_ids)
        self._width = 3 * n + 6
        self.gains = np.array(
            [
                c.position_std_rad,
                c.velocity_std_rad_per_s,
                c.torque_std_nm,
                c.port_std_m,
                c.tip_force_std_n,
                0.0 if c.position_bits is None else 2.0 * math.pi / 2.0**c.position_bits,
                math.exp(-2.0 * math.pi * c.velocity_cutoff_hz * dt_s)
                if c.velocity == "differentiated"
                else -1.0,
                c.port_rate_hz or 0.0,
            ]
        )
        self.memory = np.zeros(NOISE + (BLOCK_TICKS + 1) * self._width + 2 * n)

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Draw from the beginning."""
        self._rng, self._begins = rng, True

    def refill(self, memory: Array) -> None:
        """Draw the noise of what is measured at the ends of the coming ticks, at first at the start too."""
        first = 0 if self._begins else 1
        rows = memory[NOISE : NOISE + (BLOCK_TICKS + 1) * self._width].reshape(-1, self._width)
        rows[first:] = self._rng.standard_normal((BLOCK_TICKS + 1 - first, self._width))
        self._begins = False
