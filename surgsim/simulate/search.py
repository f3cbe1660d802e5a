"""The start with the most room to the joint limits on its whole path, of all that an arm has.

An arm reaches a place in several ways, the branches of its inverse kinematics, and each has a self-motion:
all configurations with tip and shaft held. Random configurations, the same ones every time, are brought to
the first place and cover them. The best are improved by self-motion, on some places and then on all.
"""

import numpy as np

from surgsim.array import Array
from surgsim.simulate.reach import Reach, Start

_SEED = 20_261_129
_STARTS = 256
_PLACES = 16
"""Places that starts are first compared on."""
_CANDIDATES, _FINALISTS = 12, 3
_APART_RAD = 0.4
_COARSE, _FINE = ((0.4, 0.01), 100), ((0.05, 0.002), 30)
"""First and last length of the steps of the two improvements [rad], and how many are tried at most."""
_TIE_RAD = 1e-3
_LAST_SETTLINGS = 4


def roomiest(reach: Reach, places: Array, guess: Array, *, clear: bool) -> Start:
    """The start of largest worth for a path.

    Args:
        reach: The arm; with free joints, a start past a limit is found too, with its negative room.
        places: Places of the tip (k, 3) [m].
        guess: Joint positions (n,) [rad] that break ties: of equal starts the nearest is taken.
        clear: Whether a path without contact comes before any with one.
    """
    rng = np.random.default_rng(_SEED)
    first = [reach.settle(places[0], q) for q in _first_guesses(reach, rng, guess)]
    directions = _directions(reach, rng)
    some, every = reach.path(_some(places), clear=clear), reach.path(places, clear=clear)
    inwards = [q for q in first if reach.points_inwards(q)]
    found = [reach.start(some, q) for q in (inwards or first)]
    chosen = _apart(found, guess)[:_CANDIDATES]
    better = [reach.improved(some, each, directions, *_COARSE) for each in chosen]
    last = [reach.start(every, each.q) for each in _apart(better, guess)[:_FINALISTS]]
    best = _apart([reach.improved(every, each, directions, *_FINE) for each in last], guess)[0]
    q = reach.turned_inside(every, best.q)
    for _ in range(_LAST_SETTLINGS):  # near a singularity one is not enough; a path begins with the first
        q = reach.settle(places[0], q)
    return reach.start(every, q)


def _first_guesses(reach: Reach, rng: np.random.Generator, guess: Array) -> Array:
    """`guess`, then random configurations within the limits, of a wider range its middle turn (k, n) [rad].

    A joint that only rolls the shaft is in the middle of its range.
    """
    limits = reach.arm.limits
    middle = 0.5 * (limits.q_min + limits.q_max)
    half = np.minimum(0.5 * (limits.q_max - limits.q_min), np.pi)
    every = np.vstack([guess, middle + half * rng.uniform(-1.0, 1.0, (_STARTS, middle.size))])
    every[:, reach.joints :] = middle[reach.joints :]
    return every


def _directions(reach: Reach, rng: np.random.Generator) -> Array:
    """Random joint displacements (k, n), whose self-motion is tried; one where there is one degree of it."""
    left = reach.arm.redundancy(reach.p_WC is not None)
    every = rng.normal(size=(left if left < 2 else 2 * left, reach.arm.limits.q_min.size))
    every[:, reach.joints :] = 0.0
    return every


def _some(places: Array) -> Array:
    """Some of the places, the first and the last among them."""
    count = min(_PLACES, len(places))
    chosen: Array = places[np.round(np.linspace(0, len(places) - 1, count)).astype(int)]
    return chosen


def _apart(starts: list[Start], guess: Array) -> list[Start]:
    """The starts without those beside a better one: by worth, of equal ones the nearest to `guess` first."""
    most = max(each.worth for each in starts)
    ranked = sorted(
        starts, key=lambda each: (int((most - each.worth) / _TIE_RAD), np.linalg.norm(each.q - guess))
    )
    kept: list[Start] = []
    for each in ranked:
        if all(_distance(each.q, other.q) > _APART_RAD for other in kept):
            kept.append(each)
    return kept


def _distance(a: Array, b: Array) -> float:
    """Largest angle between two configurations' joints [rad], whole turns left out."""
    return float(np.abs((a - b + np.pi) % (2.0 * np.pi) - np.pi).max())
