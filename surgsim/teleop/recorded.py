"""A recorded network: the delay of every packet, from a CSV file."""

import csv
import hashlib
import math
from functools import lru_cache
from pathlib import Path

import numpy as np

from surgsim.array import Array

COLUMN = "delay_s"
MOST_DELAY_S = 60.0
"""A larger delay is taken for a mistake of the unit."""


def read_delays(path: str) -> tuple[Array, str]:
    """Delays of the packets (k,) [s], NaN for a lost one, and the hash of the file.

    Args:
        path: A CSV file with a column `delay_s`; an empty cell is a lost packet.

    Raises:
        ValueError: If the file cannot be read or holds no delays, with file, line and reason.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise ValueError(f"trace {path} cannot be read: {error.strerror}") from error
    found = hashlib.sha256(content).hexdigest()
    return _parsed(path, content), found


@lru_cache(maxsize=8)
def _parsed(path: str, content: bytes) -> Array:
    try:
        rows = list(csv.DictReader(content.decode().splitlines()))
    except UnicodeDecodeError as error:
        raise ValueError(f"trace {path} is no text") from error
    if not rows or COLUMN not in rows[0]:
        raise ValueError(f"trace {path} has no column {COLUMN} with rows")
    delays = np.array([_delay(path, line, row[COLUMN]) for line, row in enumerate(rows, 2)])
    if not np.isfinite(delays).any():
        raise ValueError(f"trace {path} has lost packets alone")
    delays.flags.writeable = False
    return delays


def _delay(path: str, line: int, cell: str | None) -> float:
    if cell is None or not cell.strip():
        return math.nan
    try:
        delay = float(cell)
    except ValueError as error:
        raise ValueError(f"trace {path}, line {line}: '{cell}' is no delay in seconds") from error
    if not 0.0 <= delay <= MOST_DELAY_S:
        raise ValueError(f"trace {path}, line {line}: a delay of {cell} s is not from 0 to {MOST_DELAY_S:g}")
    return delay
