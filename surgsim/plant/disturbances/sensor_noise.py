"""Sensors that are noisy, and joint positions in whole counts of the encoder."""

import math
from typing import Annotated, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.models.build import Scene
from surgsim.plant.disturbances.base import SENSOR, Disturbance, DisturbanceConfig
from surgsim.plant.state import State

Array = NDArray[np.float64]
_BLOCK = 256
_Q, _V, _TAU, _PORT, _TIP = slice(0, 7), slice(7, 14), slice(14, 21), slice(21, 24), slice(24, 27)


class SensorNoiseConfig(DisturbanceConfig):
    """White noise of all sensors, encoder steps, and a tracker of the port that measures now and then.

    Assumed where no source is named. The LWR's absolute joint sensor resolves 0.01 deg, 1.7e-4 rad (DLR); the
    default is a twentieth of it, as joint positions are taken from the motor's sensor before the gear. An
    optical tracker of the port has a static error of 0.045 mm RMS in space (Polaris Vega,
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

    def check(self, control_period_s: float) -> None:
        """Refuse a tracker or a low-pass faster than the control ticks can follow."""
        if self.port_rate_hz is not None and self.port_rate_hz * control_period_s > 1.0 + 1e-9:
            raise ValueError(
                f"sensor_noise: port_rate_hz {self.port_rate_hz:g} must be at most one measurement a control "
                f"period, {1.0 / control_period_s:g} Hz"
            )
        if self.velocity == "differentiated" and self.velocity_cutoff_hz * control_period_s > 0.5:
            raise ValueError(
                f"sensor_noise: velocity_cutoff_hz {self.velocity_cutoff_hz:g} must be at most half the "
                f"control rate, {0.5 / control_period_s:g} Hz"
            )

    def build(self, rng: np.random.Generator) -> "SensorNoise":
        """The disturbance."""
        return SensorNoise(self)


class SensorNoise(Disturbance):
    """Noise, encoder steps, differences and the tracker's hold.

    Measured from true, at tick k with independent normal n:

        q_m = r round((q + s_q n) / r),   r = 2 pi / 2^bits        (no rounding without bits)
        v_m = v + s_v n,   or   v_m = a v_m,k-1 + (1 - a) (q_m - q_m,k-1) / h,   a = exp(-2 pi f h)
        tau_m = tau + s_t n,   p_m = p_WC + s_p n,   f_m = f_T + s_f n

    with the control period h and the cut-off f. The arm is at rest before the first tick.

    Source: of the joint sensor, DLR's description of its light-weight robot; of the cut-off, libfranka's
    `kDefaultCutoffFrequency`.
    """

    rank = SENSOR

    def __init__(self, config: SensorNoiseConfig) -> None:
        self._c = c = config
        v_std = c.velocity_std_rad_per_s
        sizes = [c.position_std_rad, v_std, c.torque_std_nm, c.port_std_m, c.tip_force_std_n]
        self._std = np.repeat(sizes, [7, 7, 7, 3, 3])
        self._resolution = None if c.position_bits is None else 2.0 * math.pi / 2.0**c.position_bits
        self._rng = np.random.default_rng(0)
        self._noise = np.zeros((0, 27))
        self._tick, self._dt, self._keep = 0, 1.0, 0.0
        self._q, self._v, self._p_WC, self._frame = np.zeros(7), np.zeros(7), np.zeros(3), -1

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Forget the last run's measurements."""
        self._rng, self._dt = rng, dt_s
        self._tick, self._frame = 0, -1
        self._keep = math.exp(-2.0 * math.pi * self._c.velocity_cutoff_hz * dt_s)

    def sense(self, state: State) -> State:
        """What the sensors say of `state`."""
        noise = self._draw()
        q = state.q + noise[_Q]
        if self._resolution is not None:
            q = self._resolution * np.rint(q / self._resolution)
        differ = self._c.velocity == "differentiated"
        v = self._differentiate(q) if differ else state.v + noise[_V]
        measured = State(
            t_s=state.t_s,
            q=q,
            v=v,
            tau=state.tau + noise[_TAU],
            p_WC=self._track(state, noise[_PORT]),
            v_WC=state.v_WC,
            f_T=state.f_T + noise[_TIP],
        )
        self._tick += 1
        return measured

    def _draw(self) -> Array:
        """Noise of one tick (27,); drawn in blocks, which is faster."""
        at = self._tick % _BLOCK
        if at == 0:
            self._noise = self._std * self._rng.standard_normal((_BLOCK, 27))
        row: Array = self._noise[at]
        return row

    def _differentiate(self, q: Array) -> Array:
        """Filtered backward difference of the measured positions (7,) [rad/s]."""
        if self._tick == 0:
            self._v = np.zeros(7)
        else:
            self._v = self._keep * self._v + (1.0 - self._keep) / self._dt * (q - self._q)
        self._q = q
        return self._v.copy()

    def _track(self, state: State, noise: Array) -> Array:
        """The port's position, measured at the tracker's rate (3,) [m]."""
        rate = self._c.port_rate_hz
        if rate is None:
            return state.p_WC + noise
        frame = math.floor(state.t_s * rate + 1e-6)
        if frame != self._frame:
            self._p_WC, self._frame = state.p_WC + noise, frame
        return self._p_WC.copy()
