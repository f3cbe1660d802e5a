"""The search: CMA-ES on positions in log space, a generation at a time."""

from collections.abc import Callable, Sequence

import numpy as np
from cmaes import CMA

from surgsim.array import Array

SIGMA = 0.3
"""First step, as a share of the way from the start to the edge of the range."""


def minimise(
    costs_of: Callable[[Sequence[Array]], Sequence[float]],
    low: Array,
    high: Array,
    *,
    candidates: int,
    seed: int,
) -> None:
    """Ask for the costs of the start, then of one generation after another, until all candidates are spent.

    The generations are those of CMA-ES, with as many candidates as its rule for the number of dimensions
    says; the last one may be cut short. What is best is for `costs_of` to remember. Source: Hansen and
    Ostermeier 2001; the package cmaes (Nomura and Shibata 2024).

    Args:
        costs_of: Costs of several positions, lower is better; each position (n,).
        low: Lowest position (n,), at most 0.
        high: Highest position (n,), at least 0.
        candidates: How many positions are asked for, the start included.
        seed: Of the optimiser's random numbers.
    """
    n = low.size
    costs_of([np.zeros(n)])
    left = candidates - 1
    optimiser = _optimiser(low, high, seed)
    while left > 0:
        asked = [optimiser.ask() for _ in range(optimiser.population_size)]
        found = costs_of([x[:n] for x in asked[:left]])
        left -= len(found)
        if len(found) == len(asked):
            optimiser.tell(list(zip(asked, map(float, found), strict=True)))


def _optimiser(low: Array, high: Array, seed: int) -> CMA:
    """CMA-ES from the start; it needs two dimensions: a single gain gets one beside it that nobody reads."""
    bounds = np.column_stack((low, high))
    if low.size == 1:
        bounds = np.vstack((bounds, [[-1.0, 1.0]]))
    return CMA(mean=np.zeros(len(bounds)), sigma=SIGMA, bounds=bounds, seed=seed)
