"""Smooth progress along a path: at rest, speed up, constant speed, slow down, at rest.

The speed follows the smoothstep 6x^5 - 15x^4 + 10x^3 during the ramps, so that acceleration is continuous
and everything starts and ends at zero velocity and acceleration.
"""

from dataclasses import dataclass


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
        t = t_s - self.hold_start_s
        if t <= 0.0:
            return 0.0, 0.0, 0.0
        if t >= self.duration_s:
            return 1.0, 0.0, 0.0
        speed = 1.0 / (self.duration_s - self.ramp_s)
        late = t > 0.5 * self.duration_s
        x, v, a = self._speeding_up(self.duration_s - t if late else t)
        if late:
            return 1.0 - speed * x, speed * v, -speed * a
        return speed * x, speed * v, speed * a

    def _speeding_up(self, t: float) -> tuple[float, float, float]:
        """Distance, speed and acceleration after `t` from rest, in units of the constant speed."""
        if t >= self.ramp_s:
            return t - 0.5 * self.ramp_s, 1.0, 0.0
        x = t / self.ramp_s
        distance = self.ramp_s * x**4 * (x * x - 3.0 * x + 2.5)
        return distance, x**3 * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * x * x * (1.0 - x) ** 2 / self.ramp_s
