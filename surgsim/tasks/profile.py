"""Smooth progress along a path: at rest, speed up, constant speed, slow down, at rest.

The speed follows the smoothstep 6x^5 - 15x^4 + 10x^3 during the ramps, so that acceleration is continuous
and everything starts and ends at zero velocity and acceleration.
"""

from dataclasses import dataclass

from surgsim.compiled import compiled


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Progress s(t) in [0, 1].

    Attributes:
        hold_start_s: Time at rest before the motion [s].
        duration_s: Time from leaving rest to reaching rest again [s].
        ramp_s: Length of each ramp [s], at most half the duration.
        hold_end_s: Time at rest after the motion [s].
    """

    hold_start_s: float
    duration_s: float
    ramp_s: float
    hold_end_s: float

    @property
    def total_s(self) -> float:
        """Time from the first hold to the end of the last [s]."""
        return self.hold_start_s + self.duration_s + self.hold_end_s

    def progress(self, t_s: float) -> tuple[float, float, float]:
        """Progress (s, s', s'') at time `t_s` [-, 1/s, 1/s^2]."""
        found: tuple[float, float, float] = progress(
            self.hold_start_s, self.duration_s, self.ramp_s, float(t_s)
        )
        return found


@compiled
def progress(hold: float, duration: float, ramp: float, t_s: float) -> tuple[float, float, float]:
    """Progress (s, s', s'') [-, 1/s, 1/s^2] at `t_s` [s]: a hold, then `duration` with ramps `ramp` [s]."""
    t = t_s - hold
    if t <= 0.0:
        return 0.0, 0.0, 0.0
    if t >= duration:
        return 1.0, 0.0, 0.0
    speed = 1.0 / (duration - ramp)
    late = t > 0.5 * duration
    x, v, a = _speeding_up(ramp, duration - t if late else t)
    if late:
        return 1.0 - speed * x, speed * v, -speed * a
    return speed * x, speed * v, speed * a


@compiled
def _speeding_up(ramp: float, t: float) -> tuple[float, float, float]:
    """Distance, speed and acceleration after `t` from rest, in units of the constant speed."""
    if t >= ramp:
        return t - 0.5 * ramp, 1.0, 0.0
    x = t / ramp
    square = x * x
    distance = ramp * square * square * (square - 3.0 * x + 2.5)
    return (
        distance,
        square * x * (10.0 - 15.0 * x + 6.0 * square),
        30.0 * square * (1.0 - x) * (1.0 - x) / ramp,
    )
