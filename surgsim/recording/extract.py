"""Takes the columns out of a recording; run as a program by `read`, because rerun's reader may abort.

On a damaged file the reader can panic, print a backtrace or ask for more memory than there is, which ends the
process. A program of its own keeps that away from the caller.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from rerun.chunk import RrdReader

from surgsim.array import Array
from surgsim.errors import RecordingError
from surgsim.recording.encoding import decode
from surgsim.recording.layout import APPLICATION, COLUMNS, HEADER, SEAL, Header, check_version, seal


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
        RecordingError: If rerun cannot read the file, or it does not hold what was written.
    """
    try:
        texts, packed = _header(_batches(file))
        sha256 = texts.pop(SEAL, None)
        if packed is None or seal(packed, texts) != sha256:
            raise ValueError("damaged recording: it does not hold what was written")
        header = Header.from_texts(texts)
        width = sum(len(block.columns) for block in header.blocks)
        return texts, decode(packed, header.rows, width)
    except (ValueError, pa.ArrowException) as error:
        raise RecordingError(f"{file}: {error}") from error


def _batches(file: Path) -> list[pa.RecordBatch]:
    """Record batches of the header."""
    try:
        reader = RrdReader(file)
        ids = [entry.application_id for entry in reader.recordings()]
        chunks = list(reader.stream().filter(content=[f"/{HEADER}"])) if ids == [APPLICATION] else []
        batches = [chunk.to_record_batch() for chunk in chunks]
        for batch in batches:
            batch.validate(full=True)
    except (OSError, ValueError, RuntimeError, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[:200]
        raise RecordingError(f"{file}: damaged recording: {reason}") from error
    if ids != [APPLICATION]:
        found = ", ".join(ids) or "nothing"
        raise RecordingError(f"{file}: not a recording of one surgsim run, but of {found}")
    return batches


def _header(batches: Sequence[pa.RecordBatch]) -> tuple[dict[str, str], bytes | None]:
    """The header's texts, and the packed columns if it has them.

    Raises:
        ValueError: If there is no header, or it is of another version.
    """
    texts: dict[str, str] = {}
    packed: bytes | None = None
    for batch in batches:
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            value = column[-1].as_py() if len(column) else None
            if not (isinstance(value, list) and len(value) == 1):
                continue
            if name == COLUMNS and isinstance(value[0], bytes):
                packed = value[0]
            elif isinstance(value[0], str):
                texts[name] = value[0]
    if not texts:
        raise ValueError("damaged recording: its header is missing")
    check_version(texts)
    return texts, packed


if __name__ == "__main__":
    main(Path(sys.argv[1]))
