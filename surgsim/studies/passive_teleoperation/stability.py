"""When a push that is only held counts as stable."""

from typing import Literal

Steadiness = Literal["rests", "decays", "chatters", "oscillates", "grows", "runs away", "stopped"]

REST_MM_PER_S = 5.0
"""RMS speed of a handle at rest; tremor alone moves it by about 1 mm/s."""
STEADY_N, STEADY_SHARE = 0.5, 0.05
"""Standard deviation of a steady contact force: at most this, or this share of its mean."""
GROWTH, DECAY = 1.05, 0.8
"""Ratio of the handle's RMS speeds in the last two windows above which it grows, below which it decays."""
FAST_MM_PER_S = 150.0
"""RMS speed as high as the operator ever means to move, while it means to rest."""

UNSTABLE: tuple[Steadiness, ...] = ("oscillates", "grows", "runs away", "stopped")


def steadiness(
    outcome: str, speed_before: float, speed_end: float, force_mean: float, force_deviation: float
) -> Steadiness:
    """How a push ends, from its last two windows.

        stopped      the run did not complete: a safety limit was passed
        rests        handle below 5 mm/s RMS, contact force steady
        chatters     handle at rest, contact force not
        runs away    the handle moves at 150 mm/s RMS or more
        decays       the handle still moves, with at most 0.8 times the speed of the window before
        grows        at least 1.05 times that speed
        oscillates   neither: it neither dies away nor grows

    Args:
        outcome: How the run ended.
        speed_before: RMS speed of the handle in the window before the last [mm/s].
        speed_end: The same in the last window [mm/s].
        force_mean: Mean contact force in the last window [N].
        force_deviation: Its standard deviation [N].
    """
    if outcome != "completed":
        return "stopped"
    if speed_end <= REST_MM_PER_S:
        steady = force_deviation <= max(STEADY_N, STEADY_SHARE * force_mean)
        return "rests" if steady else "chatters"
    if speed_end >= FAST_MM_PER_S:
        return "runs away"
    ratio = speed_end / max(speed_before, 1e-9)
    if ratio >= GROWTH:
        return "grows"
    return "decays" if ratio <= DECAY else "oscillates"
