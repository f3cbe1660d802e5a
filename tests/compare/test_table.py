"""The tidy table: its types, its nulls, the same in both files, and what is said of damaged ones."""

import hashlib
import json
import math
import os
import re
import sys
from pathlib import Path

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from surgsim.compare.columns import Kind, Table, csv_text, read_csv
from surgsim.compare.table import MACHINE_COLUMNS, Row, keep_table, read_table, schema, write_table
from surgsim.errors import SurgsimError
from surgsim.metrics.catalog import METRICS
from surgsim.recording.sealed import sealed

TEXT = {"run_id", "suite", "scenario", "controller", "parameters", "outcome", "outcome_detail"}
TEXT |= {"success_reason", "exceeded"}
TEXT |= {"scenario_sha256", "code_sha256", "surgsim_version", "commit", "machine", "folder", "recording"}

FILES = ["runs", "runs.csv", "runs.csv.sha256", "runs.parquet"]
HELD = {"metric": "rcm_error_max_mm", "value": 9.0, "most": 5.0, "source": "x", "exceeded": True}


def summary(**changes):
    made = {
        "schema_version": 2,
        "scenario": "circle",
        "controller": "vprnn",
        "seed": 3,
        "outcome": {"name": "completed", "sentence": "", "t_s": 0.1 + 0.2, "detail": "", "data": {}},
        "success": False,
        "success_reason": "made up",
        "thresholds": [HELD, {**HELD, "metric": "tip_error_max_mm", "exceeded": False}],
        "metrics": {name: 1.0 / (3 + i) for i, name in enumerate(METRICS)},
        "provenance": {
            "surgsim": "1.0",
            "code_sha256": "cd",
            "commit": None,
            "machine": "Linux x86_64",
            "scenario_sha256": "ab",
            "wall_time_s": 0.5,
        },
    }
    return {**made, **changes}


@pytest.fixture
def results(tmp_path):
    """Writes `metrics.json` files and gives their rows."""

    def write(*summaries):
        rows = []
        for i, content in enumerate(summaries):
            folder = tmp_path / "runs" / str(i)
            folder.mkdir(parents=True)
            (folder / "metrics.json").write_text(json.dumps(sealed(content)))
            rows.append(
                Row(run_id=str(i), suite="small", parameters={"b": [1], "a": "x"}, folder=f"runs/{i}")
            )
        return rows

    return write


FAILED = {"name": "worker_died", "sentence": "", "t_s": 0.0, "detail": 'exit, "code"\n-9', "data": {}}


@pytest.fixture
def table(results, tmp_path):
    undefined = {**summary()["metrics"], "rcm_error_max_mm": None}
    return write_table(
        tmp_path, results(summary(), summary(outcome=FAILED, metrics={}), summary(metrics=undefined))
    )


def test_every_column_has_its_type(table):
    types = dict(schema())
    assert list(table.columns) == list(types)
    assert {name for name, kind in types.items() if kind is Kind.TEXT} == TEXT
    assert types.pop("seed") is Kind.INTEGER
    assert types.pop("success") is Kind.TRUTH
    numbers = {name for name, kind in types.items() if kind is Kind.NUMBER}
    assert numbers == {*METRICS, "outcome_t_s", "wall_time_s"}
    assert set(MACHINE_COLUMNS) == {
        "control_time_p50_us",
        "control_time_p99_us",
        "deadline_miss_fraction",
        "wall_time_s",
    }


def test_a_failed_run_is_a_row_without_metrics(table):
    row = table.rows()[1]
    assert (row["outcome"], row["outcome_detail"]) == ("worker_died", 'exit, "code"\n-9')
    assert [row[name] for name in METRICS] == [None] * len(METRICS)
    assert (row["seed"], row["wall_time_s"]) == (3, 0.5)


def test_success_stands_beside_the_outcome(table):
    row = table.rows()[0]
    assert (row["outcome"], row["success"], row["success_reason"]) == ("completed", False, "made up")
    assert row["exceeded"] == "rcm_error_max_mm"


def test_what_is_not_defined_is_null_and_the_rest_is_exact(table):
    first, _, last = table.rows()
    assert {name: first[name] for name in METRICS} == summary()["metrics"]
    assert last["rcm_error_max_mm"] is None
    assert first["outcome_t_s"] == 0.1 + 0.2
    assert first["parameters"] == '{"a": "x", "b": [1]}'
    assert (first["commit"], first["recording"]) == (None, None)


def test_a_recording_is_named_when_it_is_there(results, tmp_path):
    rows = results(summary(), summary())
    (tmp_path / "runs" / "1" / "recording.rrd").write_text("")
    assert write_table(tmp_path, rows)["recording"] == (None, "runs/1/recording.rrd")


def test_both_files_hold_the_same_table(table, tmp_path):
    assert read_table(tmp_path) == table
    arrow = table.to_arrow(schema())
    assert pa.parquet.read_table(tmp_path / "runs.parquet").equals(arrow)
    options = pa.csv.ConvertOptions(
        column_types=arrow.schema, strings_can_be_null=True, quoted_strings_can_be_null=False
    )
    parsing = pa.csv.ParseOptions(newlines_in_values=True)
    again = pa.csv.read_csv(tmp_path / "runs.csv", convert_options=options, parse_options=parsing)
    assert again.equals(arrow)
    assert arrow.to_pylist() == table.rows()
    assert sorted(path.name for path in tmp_path.iterdir()) == FILES


def test_the_checksum_is_that_of_sha256sum(table, tmp_path):
    digest = hashlib.sha256((tmp_path / "runs.csv").read_bytes()).hexdigest()
    assert (tmp_path / "runs.csv.sha256").read_text() == f"{digest}  runs.csv\n"


def test_without_pyarrow_there_is_no_parquet_and_none_of_another_table(results, tmp_path, monkeypatch):
    rows = results(summary(), summary())
    write_table(tmp_path, rows[:1])
    assert (tmp_path / "runs.parquet").is_file()
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    table = write_table(tmp_path, rows)
    assert read_table(tmp_path) == table
    assert len(table) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["runs", "runs.csv", "runs.csv.sha256"]
    with pytest.raises(SurgsimError, match=r"^to_arrow needs pyarrow: pip install surgsim$"):
        table.to_arrow(schema())


KINDS = {"text": Kind.TEXT, "integer": Kind.INTEGER, "number": Kind.NUMBER, "truth": Kind.TRUTH}
VALUES = st.fixed_dictionaries(
    {
        "text": st.none() | st.text(st.characters(exclude_categories=["Cs"])),
        "integer": st.none() | st.integers(-(2**63), 2**63 - 1),
        "number": st.none() | st.floats(allow_nan=False),
        "truth": st.none() | st.booleans(),
    }
)


@given(st.lists(VALUES))
@example([{"text": ""}, {"text": 'a"b,c\r\nd'}, {"number": -0.0}, {"number": math.inf}, {}])
def test_any_table_is_the_same_from_csv_and_from_parquet(rows):
    table = Table.of_rows(rows, KINDS)
    back = read_csv(csv_text(table).encode().decode(), KINDS)
    assert repr(back) == repr(table)
    content = pa.BufferOutputStream()
    pa.parquet.write_table(table.to_arrow(KINDS), content)
    columns = pa.parquet.read_table(pa.BufferReader(content.getvalue())).to_pydict()
    assert repr({name: tuple(column) for name, column in columns.items()}) == repr(dict(back.columns))


@pytest.mark.parametrize(
    ("name", "value"),
    [("text", 1), ("integer", 1.0), ("integer", True), ("integer", 2**63), ("number", "1"), ("number", True)],
)
def test_a_value_of_another_kind_is_refused(name, value):
    with pytest.raises(ValueError, match=f"column '{name}' is to hold"):
        Table.of_rows([{name: value}], KINDS)


def test_numbers_survive_the_csv_bit_for_bit(results, tmp_path):
    odd = [0.1 + 0.2, 1e-300, 5e-324, 1.7976931348623157e308, 1.0 / 3.0, 123456789.123456789, -0.0]
    name = next(iter(METRICS))
    rows = results(*[summary(metrics={name: value}) for value in odd])
    write_table(tmp_path, rows)
    back = list(read_table(tmp_path)[name])
    assert back == odd == pa.csv.read_csv(tmp_path / "runs.csv")[name].to_pylist()
    assert math.copysign(1.0, back[-1]) == -1.0


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "Expecting value"),
        ('{"scenario": "circle"}', "it has no sha256"),
        ('{"scenario": "circle", "sha256": "00"}', "its sha256 differs"),
        (json.dumps(sealed({"scenario": "circle"})), "'schema_version'"),
        (
            json.dumps(sealed({"schema_version": 3, "outcome": {"name": "completed"}})),
            "schema_version 3, but",
        ),
        (
            json.dumps(sealed({"schema_version": 2, "outcome": {"name": "finished"}})),
            "is not a run's outcome",
        ),
        ("[]", "it holds no object"),
        ("[" * 100_000, "it is nested too deeply"),
    ],
)
def test_a_damaged_metrics_json_is_named(results, tmp_path, text, reason):
    rows = results(summary())
    path = tmp_path / "runs" / "0" / "metrics.json"
    path.write_text(text)
    with pytest.raises(SurgsimError) as error:
        write_table(tmp_path, rows)
    assert str(error.value).startswith(f"{path} is not a run's metrics.json: ")
    assert reason in str(error.value)


@pytest.mark.parametrize("metrics", [[1, 2], {"tip_error_rms_mm": "large"}])
def test_metrics_of_the_wrong_kind_are_an_error_too(results, tmp_path, metrics):
    rows = results(summary(metrics=metrics))
    with pytest.raises(SurgsimError, match=r"metrics\.json"):
        write_table(tmp_path, rows)


def test_a_folder_without_a_table(tmp_path):
    with pytest.raises(SurgsimError) as error:
        read_table(tmp_path)
    text = f"{tmp_path} holds no runs.csv: it is no folder of batch results"
    assert str(error.value) == text


def test_a_batch_without_its_table_says_how_many_runs_are_there_and_counts_no_draft(tmp_path):
    (tmp_path / "suite.json").write_text("{}")
    for name in ("base-seed0", "base-seed1", ".base-seed2.abc123.part"):
        folder = tmp_path / "runs" / "circle" / "pinv" / name
        folder.mkdir(parents=True)
        (folder / "metrics.json").write_text("{}")
    with pytest.raises(SurgsimError) as error:
        read_table(tmp_path)
    assert str(error.value) == f"{tmp_path}: the batch is not finished: 2 runs there, no table yet"


def test_a_damaged_table(table, tmp_path):
    path = tmp_path / "runs.csv"
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(SurgsimError) as error:
        read_table(tmp_path)
    assert str(error.value) == f"{path} is damaged: it does not hold what `surgsim compare` wrote"


def test_a_table_of_something_else(table, tmp_path):
    path = tmp_path / "runs.csv"
    keep_table(tmp_path, table.without(["seed"]))
    with pytest.raises(SurgsimError) as error:
        read_table(tmp_path)
    assert str(error.value) == f"{path} has no column 'seed': it is not a table of this version"
    keep_table(tmp_path, Table.of_rows([], schema()))
    with pytest.raises(SurgsimError) as error:
        read_table(tmp_path)
    assert str(error.value) == f"{path} has no rows"


def test_a_metric_that_came_after_the_batch_is_null(table, tmp_path):
    before = table.without(["tip_control_error_rms_mm"])
    keep_table(tmp_path, before)
    found = read_table(tmp_path)
    assert found["tip_control_error_rms_mm"] == (None,) * len(table)
    assert list(found.columns) == list(schema())
    assert found.without(["tip_control_error_rms_mm"]) == before


def test_a_writer_that_ends_half_way_leaves_no_checksum_beside_another_table(table, tmp_path, monkeypatch):
    def refuse(source, target):
        if Path(target).name == "runs.parquet":
            raise OSError(28, "No space left on device")
        real(source, target)

    real = os.replace
    monkeypatch.setattr("surgsim.recording.files.os.replace", refuse)
    with pytest.raises(SurgsimError, match="No space left"):
        keep_table(tmp_path, table.without(["commit"]))
    assert not (tmp_path / "runs.csv.sha256").exists()


def test_shards_that_end_at_the_same_time_do_not_disturb_each_other(results, tmp_path, monkeypatch):
    """The second writes the whole table while the first is between writing its draft and renaming it."""
    rows, inner = results(summary()), []
    real = os.replace

    def replace(source, target):
        if not inner:
            inner.append(True)
            write_table(tmp_path, rows)
        real(source, target)

    monkeypatch.setattr("surgsim.recording.files.os.replace", replace)
    table = write_table(tmp_path, rows)
    assert read_table(tmp_path) == table
    assert sorted(path.name for path in tmp_path.iterdir()) == FILES


def test_every_column_is_documented():
    whole = (Path(__file__).parents[2] / "docs" / "batch.md").read_text()
    page = whole.split("## What a results folder holds")[1]
    documented = dict(re.findall(r"^\| `(\w+)` \| (text|integer|number|truth value) \| .+ \|$", page, re.M))
    assert documented == {name: kind.value for name, kind in schema().items() if name not in METRICS}
    assert [name for name in MACHINE_COLUMNS if f"`{name}`" not in whole] == []
