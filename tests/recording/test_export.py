import csv
import json
import math
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from surgsim.errors import SurgsimError
from surgsim.recording.export import export
from surgsim.trace.trace import Trace

JOINTS = range(1, 8)
REQUIRED = [
    "t_s",
    *(f"q{i}_rad" for i in JOINTS),
    *(f"v{i}_rad_per_s" for i in JOINTS),
    *(f"tau{i}_nm" for i in JOINTS),
    *(f"qdot_ref{i}_rad_per_s" for i in JOINTS),
    *(f"{point}_{axis}_m" for point in ("tip", "tip_ref", "wrist", "trocar") for axis in "xyz"),
    "tip_error_m",
    "rcm_error_m",
    "manipulability",
    "control_time_s",
]


def test_parquet(trace: Trace, tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    export(trace, path)
    table = pq.read_table(path)
    assert table.column_names == list(trace.columns)
    assert set(REQUIRED) <= set(table.column_names)
    values = np.column_stack([column.to_numpy() for column in table.columns])
    assert np.array_equal(values.view(np.uint64), trace.data.view(np.uint64))
    units = {field.name: field.metadata[b"unit"].decode() for field in table.schema}
    assert units["t_s"] == "s"
    assert units["tau3_nm"] == "nm"
    assert units["v1_rad_per_s"] == "rad_per_s"
    assert units["manipulability"] == "1"
    meta = json.loads(table.schema.metadata[b"surgsim.trace_meta"])
    assert meta == json.loads(trace.meta.to_json())
    assert pq.ParquetFile(path).metadata.row_group(0).column(0).compression == "ZSTD"


def test_csv(trace: Trace, tmp_path: Path) -> None:
    path = tmp_path / "run.CSV"
    export(trace, path)
    with path.open(newline="") as stream:
        head, *rows = list(csv.reader(stream))
    assert head == list(trace.columns)
    values = np.array([[float(x) if x else math.nan for x in row] for row in rows])
    assert np.array_equal(values, trace.data, equal_nan=True)
    assert np.array_equal(np.signbit(values), np.signbit(trace.data))
    column = head.index("tau1_nm")
    assert rows[-1][column] == ""
    assert rows[3][column] == "-0.0"


@pytest.mark.parametrize("name", ["run.xlsx", "run"])
def test_other_suffixes(trace: Trace, tmp_path: Path, name: str) -> None:
    with pytest.raises(SurgsimError, match=r"cannot export to '.*'\. Allowed: \.csv, \.parquet\.$"):
        export(trace, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_it_appears_whole_or_not_at_all(
    trace: Trace, tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"run.{suffix}"
    path.write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("surgsim.recording.files.os.replace", full)
    with pytest.raises(SurgsimError, match="cannot be written: No space left on device"):
        export(trace, path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_an_unwritable_folder(trace: Trace, tmp_path: Path) -> None:
    with pytest.raises(SurgsimError, match="cannot be written: No such file or directory"):
        export(trace, tmp_path / "absent" / "run.csv")
