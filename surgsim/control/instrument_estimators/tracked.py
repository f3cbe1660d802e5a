"""Tracked: the arm's geometry learnt while it works, from an instrument that a tracker sees."""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.instrument_estimators.base import KernelInstrumentEstimator
from surgsim.control.instrument_estimators.geometry import fill_columns, parameters
from surgsim.models.arm import ArmModel
from surgsim.models.robot import link_names
from surgsim.tick.algebra import dot
from surgsim.tick.arrays import Record, Seen
from surgsim.tick.nominal import place
from surgsim.tick.overlay import laid_over, overlay, take
from surgsim.tick.rigid import logarithm
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import doubles, vector

Length = Annotated[float, Field(ge=0.0, le=0.1)]
Angle = Annotated[float, Field(ge=0.0, le=0.2)]
TWIST = 6


class Tracked(Record):
    """The numbers of the filter; after them the bodies (1 + n,) of `geometry`, and the priors' variances.

    Attributes:
        position_std_m: As in the config, like those down to `ramp_s`.
        angle_std_rad: s_a.
        markers_from_tip_m: L.
        tool_walk_m_per_sqrt_s: w_p.
        tool_walk_rad_per_sqrt_s: w_a.
        smoothing_s: T_f.
        ramp_s: T_r.
        p_TA: The shaft's entry in the nominal tip's frame (3,) [m].
    """

    SHAPES: ClassVar[dict[str, str]] = {"p_TA": "3"}

    position_std_m: float
    angle_std_rad: float
    markers_from_tip_m: float
    tool_walk_m_per_sqrt_s: float
    tool_walk_rad_per_sqrt_s: float
    smoothing_s: float
    ramp_s: float
    p_TA: Array


class Learnt(Record):
    """What is remembered; after it estimate x, smoothed x, covariance, work space, and past joint positions.

    Attributes:
        ticks: Ticks so far.
        samples: The tracker's samples so far.
        begun_s: Time of the first [s].
        last_s: Time of the last [s].
    """

    ticks: int
    samples: int
    begun_s: float
    last_s: float


TRACKED, TRACKED_SIZE = overlay(Tracked)
LEARNT, LEARNT_SIZE = overlay(Learnt)


class TrackedInstrumentConfig(PartConfig):
    """Learns the errors of the geometry from a tracked instrument, as one set that holds everywhere.

    The defaults are those of the disturbances `instrument_tracker` and `calibration_error`, with an error of
    the base as registration leaves it. With 0 for base, links and joints the filter follows the instrument
    alone, and forgets as fast as its walk says.

    Attributes:
        position_std_m: White noise of each coordinate of the markers' middle [m].
        angle_std_rad: White noise of each component of the markers' rotation vector [rad].
        markers_from_tip_m: Distance of the markers' middle from the tip along the shaft [m].
        base_position_m: Standard deviation of the base's place, of each coordinate, before anything is
            learnt [m]; 0: it is known. The following likewise.
        base_angle_rad: Rotation vector of the base [rad].
        link_position_m: Place of each link's frame in that of its parent [m].
        link_angle_rad: Rotation vector of each link's frame in that of its parent [rad].
        joint_offset_rad: True joint position minus the encoder's [rad].
        tool_position_m: Place of the instrument [m].
        tool_angle_rad: Rotation vector of the instrument about its shaft's entry [rad].
        tool_walk_m_per_sqrt_s: How much the instrument's place may wander [m/sqrt(s)].
        tool_walk_rad_per_sqrt_s: How much its rotation may wander [rad/sqrt(s)].
        smoothing_s: Time constant with which the control follows what is learnt [s].
        ramp_s: Time over which the first correction is let in [s].
        most_age_ticks: Oldest sample that still counts, in control periods older than the joint positions.
    """

    type: Literal["tracked"] = "tracked"
    position_std_m: PositiveFloat = 4.5e-5
    angle_std_rad: PositiveFloat = 4.5e-4
    markers_from_tip_m: NonNegativeFloat = 0.4
    base_position_m: Length = 1e-3
    base_angle_rad: Angle = 1e-3
    link_position_m: Length = 3e-4
    link_angle_rad: Angle = 3e-4
    joint_offset_rad: Angle = 5e-4
    tool_position_m: Length = 5e-4
    tool_angle_rad: Angle = 5e-4
    tool_walk_m_per_sqrt_s: NonNegativeFloat = 0.0
    tool_walk_rad_per_sqrt_s: NonNegativeFloat = 0.0
    smoothing_s: PositiveFloat = 0.05
    ramp_s: PositiveFloat = 0.5
    most_age_ticks: Annotated[int, Field(ge=0, le=1000)] = 100

    def build(self, arm: ArmModel) -> KernelInstrumentEstimator:
        """The filter for the geometry of an arm."""
        n = arm.limits.q_min.size
        numbers = np.zeros(TRACKED_SIZE)
        record = laid_over(Tracked, numbers)
        take(record, self)
        record.p_TA[:] = arm.p_TA
        m = parameters(n)
        return KernelInstrumentEstimator(
            kernel=tracked_instrument,
            arm=arm,
            gains=np.concatenate((numbers, bodies(arm), self.variances(n))),
            memory_size=LEARNT_SIZE + m * (m + 3 + TWIST) + n * (self.most_age_ticks + 1),
        )

    def variances(self, n: int) -> Array:
        """Variances before anything is learnt (7 n + 12,) [m^2, rad^2]."""

        def six(position: float, angle: float) -> list[float]:
            return [position] * 3 + [angle] * 3

        deviations = [
            *six(self.base_position_m, self.base_angle_rad),
            *six(self.link_position_m, self.link_angle_rad) * n,
            *[self.joint_offset_rad] * n,
            *six(self.tool_position_m, self.tool_angle_rad),
        ]
        return np.square(deviations)


def bodies(arm: ArmModel) -> Array:
    """Numbers of the base's body and of the body before each joint (1 + n,)."""
    model = arm.scene.model
    links = [model.body(name).parentid.item() for name in link_names(arm.limits.q_min.size)]
    return np.array([model.body("base").id, *links], dtype=np.float64)


@compiled
def tracked_instrument(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """A Kalman filter of the geometry's errors x, and the correction that they are at the present posture.

        T_WT = T_WN(q) exp(H(q) x),   y = log(T_WN(q_s)^-1 T_m),   y = H(q_s) x + noise
        z' = (x - z) / T_f,   twist = s((t - t_1) / T_r) H(q) z

    x is constant with the priors as its first covariance, but for the instrument's part, a random walk.
    q_s are the joint positions of the sample's time. The noise is that of the markers: y and H are taken to
    their middle, where position and angle are independent. z is smooth, as stiff laws ask for; it is in x,
    not in the twist, so that the correction does not lag where the arm moves. s is the quintic from 0 to 1.

    Single parameters need not come near the truth: a path shows some of their combinations, and those it
    shows are what the correction on it takes.

    Source: ours; calibration by linearised transforms as in Hollerbach, Khalil and Gautier, Model
    Identification, Springer Handbook of Robotics (2016), 6.2; the filter is Kalman's, a scalar at a time.
    """
    law, head = gains[:TRACKED_SIZE].view(TRACKED)[0], memory[:LEARNT_SIZE].view(LEARNT)[0]
    n, m = seen.q.size, 7 * seen.q.size + 12
    numbers, variances = gains[TRACKED_SIZE : TRACKED_SIZE + 1 + n], gains[TRACKED_SIZE + 1 + n :]
    estimates, rest = memory[LEARNT_SIZE : LEARNT_SIZE + 3 * m], memory[LEARNT_SIZE + 3 * m :]
    x, z, work = estimates[:m], estimates[m : 2 * m], estimates[2 * m :]
    H, P = rest[: TWIST * m].reshape((TWIST, m)), rest[TWIST * m : (TWIST + m) * m].reshape((m, m))
    past = rest[(TWIST + m) * m :].reshape((-1, n))
    if head.ticks == 0:
        for i in range(m):
            P[i, i] = variances[i]
    past[head.ticks % past.shape[0]] = seen.q
    age = int(np.rint(seen.tracked_age_s / seen.dt_s))
    if seen.tracked_samples > head.samples and age <= min(head.ticks, past.shape[0] - 1):
        _begin_sample(law, head, seen, P)
        place(seen.elsewhere, past[(head.ticks - age) % past.shape[0]])
        fill_columns(seen.elsewhere, numbers, law.p_TA, law.markers_from_tip_m, H)
        _learn(law, seen, H, x, P, work)
    head.ticks += 1
    out[:] = 0.0
    if head.samples > 0:
        share = 1.0 - math.exp(-seen.dt_s / law.smoothing_s)
        for i in range(m):
            z[i] += share * (x[i] - z[i])
        let_in = _let_in(min((seen.t_s - head.begun_s) / law.ramp_s, 1.0))
        place(seen.elsewhere, seen.q)
        fill_columns(seen.elsewhere, numbers, law.p_TA, 0.0, H)
        for i in range(3):
            out[0, i], out[1, i] = let_in * dot(H[i], z), let_in * dot(H[3 + i], z)
    return GOES_ON


@compiled
def _let_in(u: float) -> float:
    """The quintic from 0 to 1, at rest at both ends."""
    return u * u * u * (10.0 - u * (15.0 - 6.0 * u))


@compiled
def _begin_sample(law: Tracked, head: Learnt, seen: Seen, P: Array) -> None:
    """Count a sample; the instrument's part of the covariance P (m, m) has grown since the last one."""
    if head.samples == 0:
        head.begun_s = head.last_s = seen.t_s
    first, passed_s = P.shape[0] - TWIST, seen.t_s - head.last_s
    head.samples, head.last_s = seen.tracked_samples, seen.t_s
    for i in range(TWIST):
        walk = law.tool_walk_m_per_sqrt_s if i < 3 else law.tool_walk_rad_per_sqrt_s
        P[first + i, first + i] += walk * walk * passed_s


@compiled
def _learn(law: Tracked, seen: Seen, H: Array, x: Array, P: Array, work: Array) -> None:
    """Take a sample in: estimate x (m,), covariance P (m, m), with H (6, m) of the markers' middle."""
    tip, turn = vector(seen.elsewhere.site_xpos, 3), doubles(seen.elsewhere.site_xmat, 3, 3)
    p, R, y = scratch(3), scratch_matrix(3, 3), scratch(6)
    for i in range(3):
        p[i] = 0.0
        for k in range(3):
            p[i] += turn[k, i] * (seen.p_WT_m[k] - tip[k])
        for j in range(3):
            s = 0.0
            for k in range(3):
                s += turn[k, i] * seen.R_WT_m[k, j]
            R[i, j] = s
    logarithm(p, R, y[:3], y[3:])
    y[0] -= law.markers_from_tip_m * y[4]
    y[1] += law.markers_from_tip_m * y[3]
    for row in range(TWIST):
        std = law.position_std_m if row < 3 else law.angle_std_rad
        _update(H[row], y[row], std * std, x, P, work)


@compiled
def _update(h: Array, y: float, variance: float, x: Array, P: Array, Ph: Array) -> None:
    """A measurement y = h x + noise: P -= P h h^T P / s, x += P h (y - h x) / s, s = h P h + variance."""
    m = x.size
    Ph[:] = 0.0
    for i in range(m):
        if h[i] != 0.0:
            for j in range(m):
                Ph[j] += P[i, j] * h[i]
    s = dot(h, Ph) + variance
    gap = (y - dot(h, x)) / s
    for i in range(m):
        x[i] += Ph[i] * gap
        c = Ph[i] / s
        for j in range(m):
            P[i, j] -= c * Ph[j]
