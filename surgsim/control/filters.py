"""Gains of filters that follow a measured position and infer what drives it."""

import math

from surgsim.compiled import compiled


@compiled
def filter_gains(state_hz: float, disturbance_hz: float, dt: float) -> tuple[float, float, float]:
    """The gains a, b, g of a filter of third order with two poles at `state_hz` and one at `disturbance_hz`.

    With poles p_1, p_2, p_3 = exp(-2 pi f T):

        a = 1 - p_1 p_2 p_3,  g = (1 - p_1)(1 - p_2)(1 - p_3),  b = 3 - a - g/2 - p_1 - p_2 - p_3

    Example:
        >>> [round(gain, 4) for gain in filter_gains(20.0, 20.0, 0.001)]
        [0.314, 0.0395, 0.0016]
    """
    p, r = math.exp(-2.0 * math.pi * state_hz * dt), math.exp(-2.0 * math.pi * disturbance_hz * dt)
    a, g = 1.0 - p * p * r, (1.0 - p) * (1.0 - p) * (1.0 - r)
    return a, 3.0 - a - 0.5 * g - 2.0 * p - r, g
