"""A trace as a table for other tools: Parquet or CSV, one row per control tick."""

import os
from collections.abc import Callable
from pathlib import Path

from surgsim.errors import SurgsimError
from surgsim.recording.files import replacing, write_file
from surgsim.trace.trace import Trace


def export(trace: Trace, path: str | os.PathLike[str]) -> None:
    """Write the columns of `trace`, in SI units that their names end with.

    Parquet carries each column's unit in its field's metadata and the run's meta data (JSON) in the schema's,
    both as plain text. CSV has a line of names, then numbers that read back to the same bits; NaN is an
    empty field.

    Args:
        trace: The run.
        path: File to write, `.parquet` or `.csv`; replaced if it exists, and never left half written.

    Raises:
        SurgsimError: If the suffix is another one, or the file cannot be written.
    """
    file = Path(path)
    check_export(file)
    with replacing(file) as temporary:
        write_file(temporary, _ENCODERS[file.suffix.lower()](trace))


def check_export(path: Path) -> None:
    """Refuse a file that `export` does not write.

    Raises:
        SurgsimError: If its suffix is another one.
    """
    if path.suffix.lower() not in _ENCODERS:
        raise SurgsimError(
            f"{path}: cannot export to '{path.suffix}'. Allowed: {', '.join(sorted(_ENCODERS))}."
        )


def _parquet(trace: Trace) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    units = [block.unit for block in trace.blocks for _ in block.columns]
    fields = [
        pa.field(name, pa.float64(), metadata={"unit": unit or "1"})
        for name, unit in zip(trace.columns, units, strict=True)
    ]
    schema = pa.schema(fields, metadata={"surgsim.trace_meta": trace.meta.to_json()})
    table = pa.Table.from_arrays([pa.array(trace[name]) for name in trace.columns], schema=schema)
    content = pa.BufferOutputStream()
    pq.write_table(table, content, compression="zstd")
    return bytes(content.getvalue())


def _csv(trace: Trace) -> bytes:
    rows = (",".join("" if x != x else repr(x) for x in row.tolist()) for row in trace.data)
    return "\n".join((",".join(trace.columns), *rows, "")).encode("ascii")


_ENCODERS: dict[str, Callable[[Trace], bytes]] = {".parquet": _parquet, ".csv": _csv}
