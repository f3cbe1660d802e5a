"""A tracker that measures where the instrument really is, now and then."""

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
    whole_ticks,
)
from surgsim.plant.part import BLOCK_TICKS
from surgsim.tick.algebra import dot
from surgsim.tick.arrays import World
from surgsim.tick.rigid import exponential
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import site_place, site_turn

POSITION_STD, ANGLE_STD, MARKERS, RATE, DELAY, LOST, DROPOUT, FIELD, FIELD_ANGLE, STRAIGHT = range(10)
"""Gains: s_p [m], s_a [rad], L [m], rate [Hz], delay [ticks], when it is lost [s], the probability of a
missed frame, amplitudes of the field [m] and [rad]; the straight instrument's tip in the frame of the shaft's
entry, place (3,) [m] and orientation (3, 3); then the field's waves."""
FIRST_WAVE = STRAIGHT + 12
WAVES = 4
"""Waves of each of the field's six components: wave vector (3,) [rad/m] and phase [rad]."""
FRAME, TAKEN, GIVEN, SLOTS = range(4)
"""Memory: frames so far, samples taken, samples given; then the noise's rows, then the samples in a ring."""
DRAWS = 7
"""Numbers drawn for a tick: noise of position and angle, and whether the frame is missed."""
SAMPLE = 13
"""A sample: the tick that it is of, position (3,) [m], orientation (3, 3)."""


@compiled
def track(gains: Array, world: World, memory: Array, out: Array) -> int:
    """The instrument's pose from the markers on it, at the tracker's rate, late by its delay.

        p_M = p_WT - L d,   p_m = p_M + s_p n_p + f(p_M),   R_m = R_WT exp([s_a n_a + g(p_M)]x)
        p_WT,m = p_m + L d_m

    with independent normal n, the shaft's axis d and the static field f, g. Where the shaft bends, p_WT and d
    are those of a straight one: markers at its upper end do not see that it is bent. A sample holds until the
    next one is given; its age says which joint positions it belongs to.
    """
    now, ring = world.tick, memory[SLOTS + (BLOCK_TICKS + 1) * DRAWS :]
    slots = ring.size // SAMPLE
    row = drawn_row(now)
    drawn = memory[SLOTS + row * DRAWS : SLOTS + (row + 1) * DRAWS]
    frame = frame_at(world.t_s, gains[RATE])
    if frame != memory[FRAME]:
        memory[FRAME] = frame
        if world.t_s < gains[LOST] and drawn[6] >= gains[DROPOUT]:
            at = int(memory[TAKEN]) % slots * SAMPLE
            memory[TAKEN] += 1.0
            _take(gains, world, drawn, ring[at : at + SAMPLE])
    while memory[GIVEN] < memory[TAKEN]:
        if ring[int(memory[GIVEN]) % slots * SAMPLE] + gains[DELAY] > now:
            break
        memory[GIVEN] += 1.0
    world.tracked_samples = int(memory[GIVEN])
    if memory[GIVEN] > 0.0:
        at = (int(memory[GIVEN]) - 1) % slots * SAMPLE
        world.tracked_age_s = (now - ring[at]) * world.dt_s
        for i in range(3):
            world.p_WT_m[i] = ring[at + 1 + i]
            for k in range(3):
                world.R_WT_m[i, k] = ring[at + 4 + 3 * i + k]
    return GOES_ON


@compiled
def _take(gains: Array, world: World, drawn: Array, sample: Array) -> None:
    """Measure the pose of now."""
    markers, field, turn, rest = scratch(3), scratch(6), scratch(3), scratch(3)
    true, R = scratch(9), scratch_matrix(3, 3)
    _straight(gains, world, markers, true)
    for i in range(3):
        markers[i] -= gains[MARKERS] * true[3 * i + 2]
    _field(gains, markers, field)
    for i in range(3):
        turn[i] = gains[ANGLE_STD] * drawn[3 + i] + field[3 + i]
        rest[i] = 0.0
        markers[i] += gains[POSITION_STD] * drawn[i] + field[i]
    exponential(rest, turn, rest, R)
    sample[0] = world.tick
    for i in range(3):
        for k in range(3):
            s = 0.0
            for j in range(3):
                s += true[3 * i + j] * R[j, k]
            sample[4 + 3 * i + k] = s
        sample[1 + i] = markers[i] + gains[MARKERS] * sample[4 + 3 * i + 2]


@compiled
def _straight(gains: Array, world: World, tip: Array, turn: Array) -> None:
    """Fill place (3,) [m] and orientation (9,) of the tip as a straight shaft has it."""
    entry, axes = site_place(world, world.entry), site_turn(world, world.entry)
    for i in range(3):
        tip[i] = entry[i]
        for k in range(3):
            tip[i] += axes[3 * i + k] * gains[STRAIGHT + k]
            s = 0.0
            for j in range(3):
                s += axes[3 * i + j] * gains[STRAIGHT + 3 + 3 * j + k]
            turn[3 * i + k] = s


@compiled
def _field(gains: Array, place: Array, out: Array) -> None:
    """The field's error at a place (3,) [m]: out (6,) [m, rad], a sum of waves for each component."""
    for i in range(6):
        out[i] = 0.0
        amplitude = gains[FIELD] if i < 3 else gains[FIELD_ANGLE]
        if amplitude > 0.0:
            for k in range(WAVES):
                wave = gains[FIRST_WAVE + 4 * (WAVES * i + k) : FIRST_WAVE + 4 * (WAVES * i + k + 1)]
                out[i] += amplitude / math.sqrt(WAVES) * math.sin(dot(wave[:3], place) + wave[3])


class InstrumentTrackerConfig(DisturbanceConfig):
    """A tracked instrument: its tip and shaft are measured from markers at the upper end of the shaft.

    It is an optical tracker whose markers were calibrated to the tip; whatever it measures wrong is here, and
    it has no part in the arm's geometry. Without this part the controller has no tracked instrument.

    Assumed where no source is named. 0.045 mm is the static error in space of a Polaris Vega
    (doi 10.1186/s13014-021-01804-7), here that of each coordinate; the angle is that of markers 0.1 m apart.

    Attributes:
        rate_hz: Measurements per second; the last one holds [Hz].
        position_std_m: White noise of each coordinate of the markers' middle [m].
        angle_std_rad: White noise of each component of the markers' rotation vector [rad].
        markers_from_tip_m: Distance of the markers' middle from the tip along the shaft [m].
        delay_s: Age at which a sample arrives, a whole multiple of the control period [s].
        dropout: Probability that a frame is missed.
        lost_after_s: The tracker sees nothing from then on; null: it always sees [s].
        field_m: Amplitude of the static error of each coordinate of the place, which depends on the place: a
            sum of waves whose RMS over all space is that of one wave of this amplitude [m].
        field_angle_rad: The same of each component of the rotation vector [rad].
        field_length_m: Length of the waves [m].
    """

    type: Literal["instrument_tracker"] = "instrument_tracker"
    rate_hz: PositiveFloat = 60.0
    position_std_m: NonNegativeFloat = 4.5e-5
    angle_std_rad: NonNegativeFloat = 4.5e-4
    markers_from_tip_m: NonNegativeFloat = 0.4
    delay_s: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    dropout: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.0
    lost_after_s: PositiveFloat | None = None
    field_m: NonNegativeFloat = 0.0
    field_angle_rad: NonNegativeFloat = 0.0
    field_length_m: PositiveFloat = 0.3

    def check(self, scenario: Surroundings) -> None:
        """Refuse a tracker faster than the control ticks, or a delay that is not of whole ones."""
        whole_ticks("instrument_tracker", "delay_s", self.delay_s, scenario.control_period_s)
        check_rate("instrument_tracker", "rate_hz", self.rate_hz, scenario.control_period_s)

    def build(self, rng: np.random.Generator) -> "InstrumentTracker":
        """The tracker, its field drawn."""
        return InstrumentTracker(self, rng)


def straight_tip(scene: Scene) -> Array:
    """Place [m] and orientation (12,) of the tip in the frame of the entry, with the shaft straight."""
    model, entry, tip = scene.model, scene.shaft_entry_site, scene.tip_site
    data = mujoco.MjData(model)  # at the positions that the model is made at
    mujoco.mj_kinematics(model, data)
    R_WE, R_WT = (data.site_xmat[site].reshape(3, 3) for site in (entry, tip))
    return np.concatenate((R_WE.T @ (data.site_xpos[tip] - data.site_xpos[entry]), (R_WE.T @ R_WT).ravel()))


class InstrumentTracker(Disturbance):
    """Noise, field, rate, delay and losses of a tracked instrument."""

    rank = SENSOR
    kernels: Mapping[str, Any] = {"sense": track}

    def __init__(self, config: InstrumentTrackerConfig, rng: np.random.Generator) -> None:
        self._c = config
        self._rng = np.random.default_rng(0)
        self._begins = True
        along = rng.normal(size=(6, WAVES, 3))
        along *= 2.0 * math.pi / config.field_length_m / np.linalg.norm(along, axis=2, keepdims=True)
        self._waves = np.concatenate((along, rng.uniform(0.0, 2.0 * math.pi, (6, WAVES, 1))), axis=2)

    def attach(self, scene: Scene, dt_s: float) -> None:
        """Settle the gains, and make room for noise and samples on their way."""
        c = self._c
        own = (
            c.position_std_m,
            c.angle_std_rad,
            c.markers_from_tip_m,
            c.rate_hz,
            float(round(c.delay_s / dt_s)),
            math.inf if c.lost_after_s is None else c.lost_after_s,
            c.dropout,
            c.field_m,
            c.field_angle_rad,
        )
        self.gains = np.concatenate((own, straight_tip(scene), self._waves.ravel()))
        slots = math.ceil(c.delay_s * c.rate_hz) + 2
        self.memory = np.zeros(SLOTS + (BLOCK_TICKS + 1) * DRAWS + slots * SAMPLE)

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """Draw from the beginning."""
        self._rng, self._begins = rng, True

    def refill(self, memory: Array) -> None:
        """Draw what the frames of the coming ticks need, at first that of the start too."""
        first = 0 if self._begins else 1
        rows = memory[SLOTS : SLOTS + (BLOCK_TICKS + 1) * DRAWS].reshape(-1, DRAWS)
        count = BLOCK_TICKS + 1 - first
        rows[first:, :6] = self._rng.standard_normal((count, 6))
        rows[first:, 6] = self._rng.uniform(size=count)
        self._begins = False
