"""Takes the columns out of a recording; run as a program by `read`, because rerun's reader may abort.

On a damaged file the reader can panic, print a backtrace or ask for more memory than there is, which ends the
process. A program of its own keeps that away from the caller.
"""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from rerun.chunk import RrdReader

from surgsim.columns import Block
from surgsim.errors import RecordingError
from surgsim.recording.layout import APPLICATION, HEADER, SERIES, TIMELINE, Header, series_path, timestamps
from surgsim.trace.trace import Array

_SCALARS = "Scalars:scalars"


def main(file: Path) -> None:
    """Write one line of JSON, the header's texts or what is wrong, then the columns' bytes."""
    try:
        texts, data = extract(file)
    except RecordingError as error:
        print(json.dumps({"error": str(error)}), flush=True)
        return
    print(json.dumps({"texts": texts, "shape": data.shape}), flush=True)
    sys.stdout.buffer.write(np.ascontiguousarray(data).tobytes())


def extract(file: Path) -> tuple[dict[str, str], Array]:
    """The header's texts, and all columns (rows, columns).

    Raises:
        RecordingError: If rerun cannot read the file, or it is not whole.
    """
    chunks = _chunks(file)
    try:
        texts = _texts(chunks)
        return texts, _columns(chunks, Header.from_texts(texts))
    except (ValueError, pa.ArrowException) as error:
        raise RecordingError(f"{file}: {error}") from error


def _chunks(file: Path) -> dict[str, list[pa.RecordBatch]]:
    """Record batches of the header and the series, by entity."""
    wanted: dict[str, list[pa.RecordBatch]] = {}
    try:
        reader = RrdReader(file)
        ids = [entry.application_id for entry in reader.recordings()]
        if ids == [APPLICATION]:
            for chunk in reader.stream().filter(content=[f"/{HEADER}", f"/{SERIES}/**"]):
                batch = chunk.to_record_batch()
                batch.validate(full=True)
                wanted.setdefault(chunk.entity_path.lstrip("/"), []).append(batch)
    except (OSError, ValueError, RuntimeError, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[:200]
        raise RecordingError(f"{file}: damaged recording: {reason}") from error
    if ids != [APPLICATION]:
        found = ", ".join(ids) or "nothing"
        raise RecordingError(f"{file}: not a recording of one surgsim run, but of {found}")
    return wanted


def _texts(chunks: Mapping[str, list[pa.RecordBatch]]) -> dict[str, str]:
    """The header's texts."""
    texts: dict[str, str] = {}
    for batch in chunks.get(HEADER, []):
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            value = column[-1].as_py() if len(column) else None
            if isinstance(value, list) and len(value) == 1 and isinstance(value[0], str):
                texts[name] = value[0]
    if not texts:
        raise ValueError("damaged recording: its header is missing")
    return texts


def _columns(chunks: Mapping[str, list[pa.RecordBatch]], header: Header) -> Array:
    """All columns (rows, columns).

    Raises:
        ValueError: If rows are missing or blocks are not of the same times.
    """
    parts = [_block(chunks.get(series_path(block.name), []), block, header.rows) for block in header.blocks]
    data = np.hstack([values for values, _ in parts])
    expected = timestamps(data[:, 0])
    if not all(np.array_equal(times, expected) for _, times in parts):
        raise ValueError("damaged recording: its columns are not of the same times")
    return data


def _block(batches: list[pa.RecordBatch], block: Block, rows: int) -> tuple[Array, Any]:
    """Values (rows, width) and times (rows,) of a block, in order of time."""
    batches = [batch for batch in batches if len(batch) and {TIMELINE, _SCALARS} <= {*batch.schema.names}]
    batches.sort(key=lambda batch: batch.column(TIMELINE)[0].value)
    width, found = len(block.columns), sum(len(batch) for batch in batches)
    if found != rows or not batches:
        raise ValueError(f"damaged recording: {found} of {rows} rows of '{block.name}'")
    times = np.concatenate([np.asarray(batch.column(TIMELINE)) for batch in batches])
    values = np.concatenate([np.asarray(batch.column(_SCALARS).flatten()) for batch in batches])
    if values.dtype != np.float64 or values.size != rows * width:
        raise ValueError(f"damaged recording: '{block.name}' is not {rows} rows of {width} numbers")
    return values.reshape(rows, width), times


if __name__ == "__main__":
    main(Path(sys.argv[1]))
