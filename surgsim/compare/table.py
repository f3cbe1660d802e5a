"""The tidy table: one row per run, of several arms one per arm, failures included."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from surgsim.compare.columns import Kind, Schema, Table, csv_text, read_csv
from surgsim.compare.job import OUTCOMES
from surgsim.compare.unfinished import CSV, SEAL, unfinished
from surgsim.errors import SurgsimError, unknown_name
from surgsim.metrics.catalog import METRICS, of_one_arm
from surgsim.metrics.timing import TIMING_METRICS
from surgsim.packages import installed
from surgsim.recording.files import replacing, write_file
from surgsim.recording.sealed import read_sealed
from surgsim.runs.folder import SCHEMA_VERSION
from surgsim.scenario.messages import one_line

TEXT_COLUMNS = ("run_id", "suite", "scenario", "controller")
PARQUET = "runs.parquet"
"""A copy of the table for other programs; it is not read."""
MACHINE_COLUMNS = (*sorted(TIMING_METRICS), "wall_time_s")
"""Columns that measure the machine: they differ between two equal batches."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """Where a row of the table comes from.

    Attributes:
        run_id: What tells it apart in the suite.
        suite: Name of the suite.
        parameters: Its point of the grid.
        folder: Its folder, relative to the results.
    """

    run_id: str
    suite: str
    parameters: Mapping[str, Any]
    folder: str


def schema() -> Schema:
    """Columns of the table, and what each holds."""
    after = ("scenario_sha256", "surgsim_version", "code_sha256", "commit", "machine", "folder", "recording")
    return {
        **dict.fromkeys(TEXT_COLUMNS, Kind.TEXT),
        "seed": Kind.INTEGER,
        "parameters": Kind.TEXT,
        "outcome": Kind.TEXT,
        "outcome_t_s": Kind.NUMBER,
        "outcome_detail": Kind.TEXT,
        "success": Kind.TRUTH,
        "success_reason": Kind.TEXT,
        "exceeded": Kind.TEXT,
        **dict.fromkeys(METRICS, Kind.NUMBER),
        "wall_time_s": Kind.NUMBER,
        **dict.fromkeys(after, Kind.TEXT),
    }


def read_rows(root: Path, row: Row) -> list[dict[str, Any]]:
    """A run's row, read from its folder; of several arms a row for each, `<scenario>.<arm>` by the scenario.

    Raises:
        SurgsimError: If the folder is not a whole run.
    """
    path = root / row.folder / "metrics.json"
    try:
        summary = read_sealed(path)
        _check_summary(summary)
        outcome, provenance = summary["outcome"], summary["provenance"]
        recording = f"{row.folder}/recording.rrd"
        common = {
            "suite": row.suite,
            "seed": summary["seed"],
            "parameters": json.dumps(row.parameters, sort_keys=True),
            "outcome": outcome["name"],
            "outcome_t_s": outcome["t_s"],
            "outcome_detail": outcome["detail"],
            "wall_time_s": provenance["wall_time_s"],
            "scenario_sha256": provenance["scenario_sha256"],
            "surgsim_version": provenance["surgsim"],
            "code_sha256": provenance["code_sha256"],
            "commit": provenance["commit"],
            "machine": provenance["machine"],
            "folder": row.folder,
            "recording": recording if (root / recording).is_file() else None,
        }
        name, metrics, arms = summary["scenario"], summary["metrics"], summary.get("arms")
        if not arms:
            return [{**common, **_of_arm(row.run_id, name, summary, metrics)}]
        return [
            {
                **common,
                **_of_arm(f"{row.run_id}.{arm}", f"{name}.{arm}", told, of_one_arm(metrics, arm)),
            }
            for arm, told in arms.items()
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise SurgsimError(f"{path} is not a run's metrics.json: {error}") from error


def _of_arm(
    run_id: str, scenario: str, told: Mapping[str, Any], metrics: Mapping[str, Any]
) -> dict[str, Any]:
    """What a row says of one arm."""
    return {
        "run_id": run_id,
        "scenario": scenario,
        "controller": told["controller"],
        "success": told["success"],
        "success_reason": told["success_reason"],
        "exceeded": ",".join(held["metric"] for held in told["thresholds"] if held["exceeded"]),
        **{name: metrics.get(name) for name in METRICS},
    }


def write_table(root: Path, rows: Sequence[Row]) -> Table:
    """Read every run's folder below `root` and write `runs.csv` beside them, and `runs.parquet` with pyarrow.

    Raises:
        SurgsimError: If a run is missing or damaged, or the disk refuses.
    """
    table = Table.of_rows([line for row in rows for line in _lines(root, row)], schema())
    keep_table(root, table)
    return table


def keep_table(root: Path, table: Table) -> None:
    """Write a batch's table, the checksum last: with it the batch is finished.

    Raises:
        SurgsimError: If the disk refuses.
    """
    content = csv_text(table).encode()
    copy = _parquet(table)
    seal = _seal(content)
    if _held(root / SEAL) != seal:  # never a whole checksum beside another table, whenever this ends
        open_again(root)
    _write(root / CSV, content)
    if copy is None:
        _remove(root / PARQUET)
    else:
        _write(root / PARQUET, copy)
    _write(root / SEAL, seal)


def open_again(root: Path) -> None:
    """Take the checksum away before runs are done again: until they are, the table is of others.

    Raises:
        SurgsimError: If the disk refuses.
    """
    _remove(root / SEAL)


def _write(path: Path, content: bytes) -> None:
    with replacing(path) as draft:
        write_file(draft, content)


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise SurgsimError(f"{path}: cannot be removed: {error.strerror or error}") from error


def _parquet(table: Table) -> bytes | None:
    """The table for programs that read Parquet; None without pyarrow."""
    if not installed("pyarrow"):
        return None
    import pyarrow as pa
    import pyarrow.parquet

    content = pa.BufferOutputStream()
    pa.parquet.write_table(table.to_arrow(schema()), content)
    return bytes(content.getvalue().to_pybytes())


def _seal(content: bytes) -> bytes:
    """What `sha256sum runs.csv` prints."""
    return f"{hashlib.sha256(content).hexdigest()}  {CSV}\n".encode()


def _held(path: Path) -> bytes | None:
    """The content of a file; None if there is none, or it cannot be read."""
    try:
        return path.read_bytes() if path.is_file() else None
    except OSError:
        return None


def read_table(root: Path) -> Table:
    """The table of a results folder; None in metrics that there were not yet when the batch was run.

    Raises:
        SurgsimError: If there is none, the batch is not finished, or the table is not one of surgsim's.
    """
    path = root / CSV
    if told := unfinished(root):
        raise SurgsimError(f"{root}: {told}")
    for name in (CSV, SEAL):
        if not (root / name).is_file():
            raise SurgsimError(f"{root} holds no {name}: it is no folder of batch results")
    try:
        content = path.read_bytes()
        if _seal(content) != (root / SEAL).read_bytes():
            raise SurgsimError(f"{path} is damaged: it does not hold what `surgsim compare` wrote")
        table = read_csv(content.decode(), schema())
    except (OSError, ValueError) as error:
        raise SurgsimError(f"{path} is damaged: {one_line(str(error), 200)}") from error
    missing = [name for name in schema() if name not in table.columns and name not in METRICS]
    if missing:
        raise SurgsimError(f"{path} has no column '{missing[0]}': it is not a table of this version")
    if len(table) == 0:
        raise SurgsimError(f"{path} has no rows")
    nothing = (None,) * len(table)
    return Table({name: table.columns.get(name, nothing) for name in schema()})


def _lines(root: Path, row: Row) -> list[dict[str, Any]]:
    """A run's rows, each value of its column's kind."""
    lines = read_rows(root, row)
    try:
        Table.of_rows(lines, schema())
    except ValueError as error:
        path = root / row.folder / "metrics.json"
        raise SurgsimError(f"{path} holds a value of another type: {error}") from error
    return lines


def _check_summary(summary: Mapping[str, Any]) -> None:
    """Refuse what no run of this version writes.

    Raises:
        ValueError: If there is such a thing.
    """
    version, outcome = summary["schema_version"], summary["outcome"]["name"]
    if version != SCHEMA_VERSION:
        raise ValueError(f"schema_version {version!r}, but this surgsim reads {SCHEMA_VERSION}")
    if outcome not in OUTCOMES:
        raise ValueError(unknown_name(str(outcome), "run's outcome", OUTCOMES))
    for name, value in summary["metrics"].items():
        if isinstance(value, bool) or not isinstance(value, int | float | None):
            raise ValueError(f"{name} is {value!r}, not a number or null")
