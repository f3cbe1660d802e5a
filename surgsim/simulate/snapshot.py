"""Everything that a run is at a tick: taken, and put into the same or another simulation of the scenario.

The records are copied whole but for the addresses in them, which are those of the simulation they are in.
Nominal models are functions of the joints and have no state.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, get_type_hints

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.simulate.objects import Stored
from surgsim.tick.arrays import Record
from surgsim.trace.trace import Ending

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """A run at a tick. It can be pickled where its parts can.

    Attributes:
        scenario: The scenario, as JSON.
        t_s: Simulated time [s].
        records: The records, by name.
        arrays: Numbers and memories of the parts, by name.
        rows: The rows written so far, of each arm.
        data: MuJoCo's data.
        objects: The state of what is a Python object.
        ending: How the run ended; None while it goes on.
    """

    scenario: str
    t_s: float
    records: dict[str, bytes]
    arrays: dict[str, Array]
    rows: tuple[Array, ...]
    data: mujoco.MjData
    objects: Stored
    ending: Ending | None


def content_of(record: Record) -> bytes:
    """The bytes of a record."""
    return bytes(_bytes_of(record).tobytes())


def fill(record: Record, kind: type[Record], content: bytes) -> None:
    """Give a record the content of another one of its kind, but for the addresses in it."""
    own = _bytes_of(record)
    given = np.frombuffer(content, dtype=np.uint8).copy()
    for at in _walk(record.dtype, kind, 0):
        given[at : at + 8] = own[at : at + 8]
    own[:] = given


def _bytes_of(record: Record) -> Bytes:
    """The memory of a record, not copied."""
    return np.asarray(record.base).view(np.uint8)


def _walk(layout: np.dtype[Any], kind: type[Record], at: int) -> Iterator[int]:
    """Where in a record's bytes addresses are."""
    assert layout.fields is not None
    for name, (field, offset, *_) in layout.fields.items():
        if name in kind.ADDRESSES:
            yield at + offset
        elif field.fields is not None:
            yield from _walk(field, get_type_hints(kind)[name], at + offset)
