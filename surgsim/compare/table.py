"""The tidy table: one row per run, of several arms one per arm, failures included."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from surgsim.compare.job import OUTCOMES
from surgsim.compare.unfinished import unfinished
from surgsim.errors import SurgsimError, unknown_name
from surgsim.metrics.catalog import METRICS, of_one_arm
from surgsim.metrics.timing import TIMING_METRICS
from surgsim.recording.files import replacing, write_file
from surgsim.recording.sealed import read_sealed
from surgsim.runs.folder import SCHEMA_VERSION
from surgsim.scenario.wording import one_line

TEXT_COLUMNS = ("run_id", "suite", "scenario", "controller")
PARQUET, CSV = "runs.parquet", "runs.csv"
_SEAL = b"surgsim.sha256"
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


def schema() -> pa.Schema:
    """Columns and types of the table."""
    fields = [pa.field(name, pa.string()) for name in TEXT_COLUMNS]
    fields += [pa.field("seed", pa.int64()), pa.field("parameters", pa.string())]
    fields += [pa.field("outcome", pa.string()), pa.field("outcome_t_s", pa.float64())]
    fields += [pa.field("outcome_detail", pa.string())]
    fields += [pa.field("success", pa.bool_()), pa.field("success_reason", pa.string())]
    fields += [pa.field("exceeded", pa.string())]
    fields += [pa.field(name, pa.float64()) for name in METRICS]
    fields += [pa.field("wall_time_s", pa.float64())]
    texts = ("scenario_sha256", "surgsim_version", "code_sha256", "commit", "machine", "folder", "recording")
    return pa.schema(fields + [pa.field(name, pa.string()) for name in texts])


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


def write_table(root: Path, rows: Sequence[Row]) -> pa.Table:
    """Read every run's folder below `root` and write `runs.parquet` and `runs.csv` beside them.

    Raises:
        SurgsimError: If a run is missing or damaged, or the disk refuses.
    """
    parts = [_part(root, row) for row in rows]
    table = pa.Table.from_batches(parts, schema=schema())
    # The Parquet file is last: with it the batch is finished. Two shards may end at the same time.
    _write(root / CSV, table, pa.csv.write_csv)
    _write(root / PARQUET, sealed_table(table), pa.parquet.write_table)
    return table


def _write(path: Path, table: pa.Table, write: Callable[[pa.Table, Any], None]) -> None:
    content = pa.BufferOutputStream()
    write(table, content)
    with replacing(path) as draft:
        write_file(draft, content.getvalue().to_pybytes())


def read_table(root: Path) -> pa.Table:
    """The table of a results folder; null in metrics that there were not yet when the batch was run.

    Raises:
        SurgsimError: If there is none, the batch is not finished, or the table is not one of surgsim's.
    """
    path = root / PARQUET
    if told := unfinished(root):
        raise SurgsimError(f"{root}: {told}")
    if not path.is_file():
        raise SurgsimError(f"{root} holds no {PARQUET}: it is no folder of batch results")
    try:
        table = pa.parquet.read_table(path, partitioning=None, page_checksum_verification=True)
        table.validate(full=True)
    except (OSError, ValueError, pa.ArrowException) as error:
        reason = next(iter(str(error).splitlines()), "it cannot be read")
        raise SurgsimError(f"{path} is damaged: {one_line(reason, 200)}") from error
    later = [name for name in METRICS if name not in table.column_names]
    missing = [name for name in schema().names if name not in (*table.column_names, *later)]
    if missing:
        raise SurgsimError(f"{path} has no column '{missing[0]}': it is not a table of this version")
    for field in schema():
        if field.name in later:
            continue
        if (found := table.schema.field(field.name).type) != field.type:
            raise SurgsimError(f"{path}: column '{field.name}' holds {found}, not {field.type}")
    if table.num_rows == 0:
        raise SurgsimError(f"{path} has no rows")
    if (table.schema.metadata or {}).get(_SEAL) != _digest(table):
        raise SurgsimError(f"{path} is damaged: it does not hold what `surgsim compare` wrote")
    for name in later:
        table = table.append_column(pa.field(name, pa.float64()), pa.nulls(table.num_rows, pa.float64()))
    return table.replace_schema_metadata(None)


def sealed_table(table: pa.Table) -> pa.Table:
    """`table` with the SHA-256 of its content in the meta data of its schema."""
    return table.replace_schema_metadata({_SEAL: _digest(table)})


def _digest(table: pa.Table) -> bytes:
    content = [table.schema.remove_metadata().to_string(), table.to_pylist()]
    return hashlib.sha256(json.dumps(content, default=str).encode()).hexdigest().encode()


def _part(root: Path, row: Row) -> pa.RecordBatch:
    """A run's rows as a table."""
    try:
        return pa.RecordBatch.from_pylist(read_rows(root, row), schema=schema())
    except (pa.ArrowException, OverflowError) as error:
        path = root / row.folder / "metrics.json"
        raise SurgsimError(f"{path} holds a value of another type: {error}") from error


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
