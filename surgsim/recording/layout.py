"""What a recording file holds where, and the header that makes a trace of its columns again."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from surgsim.array import Array
from surgsim.columns import Block
from surgsim.trace.trace import Trace, TraceMeta

APPLICATION = "surgsim"
SCHEMA_VERSION = 3
TIMELINE = "sim_time"
FILE_NAME = "recording.rrd"
HEADER = "surgsim"
SEAL = "sha256"
COLUMNS = "columns"
SERIES = "signals"
LIMITS = "signal_limits"  # sorts after `signals`: legends name the joints first
ERRORS = "errors_mm"
KEY = "joint_key"
SCENE = "scene"
SUMMARY = "summary"
LOG = "log"

Durations = np.ndarray[tuple[int], np.dtype[np.timedelta64]]


def series_path(block: str) -> str:
    """Entity at which a block of the trace is drawn, e.g. `signals/q`."""
    return f"{SERIES}/{block.strip('_')}"


def timestamps(t_s: Array) -> Durations:
    """Times (n,) [s] on the recording's timeline, whole nanoseconds."""
    times: Durations = np.rint(1e9 * t_s).astype("timedelta64[ns]")
    return times


def check_version(texts: Mapping[str, str]) -> None:
    """Refuse a header of another version.

    Raises:
        ValueError: If it is of one.
    """
    version = texts.get("schema_version")
    if version != str(SCHEMA_VERSION):
        raise ValueError(f"recording of schema version {version}; this surgsim reads {SCHEMA_VERSION}")


def seal(packed: bytes, texts: Mapping[str, str]) -> str:
    """SHA-256 of named texts and of the packed columns."""
    sha = hashlib.sha256(json.dumps([len(packed), sorted(texts.items())]).encode())
    sha.update(packed)
    return sha.hexdigest()


@dataclass(frozen=True, kw_only=True)
class Header:
    """Stored beside the columns; enough to rebuild the trace and to notice damage.

    Attributes:
        meta: The trace's meta data.
        metrics: Metrics at the time of writing; None where one does not apply.
        blocks: The trace's columns, in order.
        rows: Number of control ticks.
    """

    meta: TraceMeta
    metrics: Mapping[str, float | None]
    blocks: tuple[Block, ...]
    rows: int

    @staticmethod
    def of(trace: Trace, metrics: Mapping[str, float | None]) -> "Header":
        """The header that belongs to `trace`."""
        return Header(meta=trace.meta, metrics=metrics, blocks=trace.blocks, rows=len(trace))

    def to_texts(self) -> dict[str, str]:
        """The header as named texts."""
        blocks = [[block.name, list(block.labels), block.unit, block.joiner] for block in self.blocks]
        return {
            "schema_version": str(SCHEMA_VERSION),
            "trace_meta": self.meta.to_json(),
            "metrics": json.dumps(dict(self.metrics)),
            "layout": json.dumps({"blocks": blocks, "rows": self.rows}, sort_keys=True),
        }

    @staticmethod
    def from_texts(texts: Mapping[str, str]) -> "Header":
        """Inverse of `to_texts`.

        Raises:
            ValueError: If the texts are not those of a header of this version.
        """
        check_version(texts)
        try:
            layout = json.loads(texts["layout"])
            metrics = json.loads(texts["metrics"])
            return Header(
                meta=TraceMeta.from_json(texts["trace_meta"]),
                metrics={str(k): None if v is None else float(v) for k, v in metrics.items()},
                blocks=tuple(
                    Block(str(name), tuple(map(str, labels)), str(unit), str(joiner))
                    for name, labels, unit, joiner in layout["blocks"]
                ),
                rows=int(layout["rows"]),
            )
        except (KeyError, TypeError, AttributeError, ValueError) as error:
            raise ValueError(f"damaged recording: header: {error}") from error
