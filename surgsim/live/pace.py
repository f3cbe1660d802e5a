"""Keeps simulated time with the clock on the wall."""

import time
from collections.abc import Callable

_LOST_S = 0.1
_OVER_S = 1.0


class Pace:
    """Waits for the wall clock; where the simulation is too slow, lost time is given up, not caught up with.

    Args:
        clock: Wall time [s].
        sleep: Waits for a time [s].
    """

    def __init__(
        self, clock: Callable[[], float] = time.perf_counter, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        self._clock, self._sleep = clock, sleep
        self._zero = self._mark = clock()
        self._mark_t_s = 0.0
        self.factor = 1.0
        """Simulated over wall time of the last second."""

    def wait(self, t_s: float) -> None:
        """Return when the wall clock has come to the simulated time `t_s` [s]."""
        ahead = t_s - (self._clock() - self._zero)
        if ahead > 0.0:
            self._sleep(ahead)
        elif ahead < -_LOST_S:
            self._zero -= ahead
        now = self._clock()
        if now - self._mark >= _OVER_S:
            self.factor = (t_s - self._mark_t_s) / (now - self._mark)
            self._mark, self._mark_t_s = now, t_s
