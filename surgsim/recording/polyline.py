"""Which rows of a signal are drawn: few where it is smooth, its extremes where it is noise."""

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.compiled import compiled

TOLERANCE = 1e-3
"""Largest distance of the drawn line from a row that is left out, as a share of the signal's range."""

MOST_ROWS = 2000
"""Rows above which only the extremes of equal spans of time are drawn."""

_SMALLEST_SHARE = 0.05  # of the block's range: a signal that is flat beside its neighbours is drawn flat


def drawn_rows(values: Array) -> NDArray[np.intp]:
    """Rows of `values` (rows, signals) through which straight lines show them, first and last row included.

    Every drawn point is a sample at its own time. A signal that cannot be drawn within `TOLERANCE` by
    `MOST_ROWS` points, as noise cannot, keeps the largest and the smallest sample of each of many spans.
    """
    values = np.ascontiguousarray(values)
    kept = np.flatnonzero(_fan(values, _tolerances(values)))
    return kept if len(kept) <= MOST_ROWS else _extremes(values)


def _tolerances(values: Array) -> Array:
    """Distance (signals,) that nobody sees."""
    ranges = _ranges(values)
    share: Array = TOLERANCE * np.maximum(ranges, _SMALLEST_SHARE * ranges.max(initial=0.0))
    return share


@compiled
def _ranges(values: Array) -> Array:
    """Range (signals,) of the finite samples of each signal; 0 where there are none."""
    count, width = values.shape
    low, high = np.full(width, np.inf), np.full(width, -np.inf)
    for i in range(count):
        for k in range(width):
            if np.isfinite(values[i, k]):
                low[k], high[k] = min(low[k], values[i, k]), max(high[k], values[i, k])
    ranges: Array = np.maximum(high - low, 0.0)
    return ranges


@compiled
def _fan(values: Array, tolerance: Array) -> NDArray[np.bool_]:
    """Mark rows so that lines through them stay within `tolerance` of all others.

    From the last marked row, each later row narrows the fan of slopes that pass it within tolerance. A row
    outside the fan ends it, and the one before is marked. So is each row at which a signal becomes finite or
    ceases to be.
    """
    count, width = values.shape
    marked = np.zeros(count, dtype=np.bool_)
    marked[0] = marked[count - 1] = True
    low, high = np.full(width, -np.inf), np.full(width, np.inf)
    anchor = 0
    for i in range(1, count):
        inside, jump = True, False
        for k in range(width):
            before, now = values[i - 1, k], values[i, k]
            if np.isfinite(before) and np.isfinite(now):
                slope = (now - values[anchor, k]) / (i - anchor)
                inside &= low[k] <= slope <= high[k]
            elif not (before == now or (np.isnan(before) and np.isnan(now))):
                jump = True
        if jump or not inside:
            anchor = i if jump else i - 1
            marked[i - 1] = marked[anchor] = True
            low[:], high[:] = -np.inf, np.inf
        if jump:
            continue
        for k in range(width):
            if np.isfinite(values[i, k]):
                offset = values[i, k] - values[anchor, k]
                low[k] = max(low[k], (offset - tolerance[k]) / (i - anchor))
                high[k] = min(high[k], (offset + tolerance[k]) / (i - anchor))
    return marked


def _extremes(values: Array) -> NDArray[np.intp]:
    """Rows that hold the largest or smallest sample of a signal in one of equal spans."""
    count, width = values.shape
    span = -(-count * 2 * width // MOST_ROWS)
    starts = np.arange(0, count, span)
    padded = np.full((len(starts) * span, width), np.nan)
    padded[:count] = values
    padded = padded.reshape(len(starts), span, width)
    known = ~np.isnan(padded)
    highest = np.where(known, padded, -np.inf).argmax(axis=1)
    lowest = np.where(known, padded, np.inf).argmin(axis=1)
    rows = (starts[:, None, None] + np.stack([highest, lowest], axis=1)).ravel()
    return np.unique(np.append(rows, [0, count - 1]))
