"""Columns of a trace that follow from others, in one pass over its rows."""

import math
from functools import cache
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.manipulability import manipulabilities
from surgsim.tick.algebra import cross, norm
from surgsim.tick.arrays import A2, I1, Model, type_of
from surgsim.tick.scratch import scratch

Ids = NDArray[np.int64]

Q, TIP, TIP_REF, WRIST, TROCAR, TIP_ERROR, RCM_ERROR, MU, MU_6D = range(9)
"""Places in `derive`'s `at`: where the blocks of a row begin."""
DERIVED_BLOCKS = (
    "q",
    "tip",
    "tip_ref",
    "wrist",
    "trocar",
    "tip_error",
    "rcm_error",
    "manipulability",
    "manipulability_6d",
)
"""Their names: what is read, and the four that are written."""


@cache
def derive_signature(n: int) -> Any:
    """Rows = derive(model, rows, at) for n joints."""
    return types.int64(type_of(Model, n), A2, I1)


@compiled
def derive(model: Model, rows: Array, at: Ids) -> int:
    """Fill the errors of tip and RCM [m] and the manipulability in every row; NaN where what they need is.

    The RCM error is the trocar's distance from the shaft's line: |(p_WC - p_WT) x a| with the unit axis a.
    Where the tip is angled, it is that from the point in the columns `wrist`, which is then the nearest one.
    """
    reach, axis, off = scratch(3), scratch(3), scratch(3)
    for k in range(rows.shape[0]):
        row = rows[k]
        for i in range(3):
            tip = row[at[TIP] + i]
            off[i] = tip - row[at[TIP_REF] + i]
            axis[i] = tip - row[at[WRIST] + i]
            reach[i] = row[at[TROCAR] + i] - tip
        row[at[TIP_ERROR]] = norm(off)
        length = norm(axis)
        for i in range(3):
            axis[i] = axis[i] / length if length > 0.0 else math.nan
        cross(reach, axis, off)
        if model.angled:
            for i in range(3):
                off[i] = row[at[TROCAR] + i] - row[at[WRIST] + i]
        row[at[RCM_ERROR]] = norm(off)
        mu, whole = manipulabilities(model, row[at[Q] : at[Q] + model.q.size])
        row[at[MU]], row[at[MU_6D]] = mu, whole
    return len(rows)
