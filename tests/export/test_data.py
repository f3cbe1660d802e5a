"""Data files hold the bits of the trace or of the table, and other programs open them."""

import json
import re

import numpy as np
import pyarrow.parquet as pq
from scipy.io import loadmat, whosmat

from surgsim.compare.table import read_table
from surgsim.export.columns import matlab_names
from surgsim.metrics.catalog import METRICS

RESULTS = "results/vprnn"


def test_npz_of_a_run(run, run_folder, told, tmp_path):
    assert told(run_folder, "--data", tmp_path / "run.npz")[0] == 0
    with np.load(tmp_path / "run.npz", allow_pickle=False) as found:
        assert {*run.trace.columns} == {*found.files} - {"surgsim_units", "surgsim_about"}
        for name in run.trace.columns:
            assert found[name].tobytes() == run.trace[name].tobytes(), name
        units = dict(found["surgsim_units"].tolist())
        about = json.loads(str(found["surgsim_about"]))
    assert (units["t_s"], units["q1_rad"], units["manipulability"]) == ("s", "rad", "1")
    assert about["scenario"]["controller"]["name"] == "pinv"
    assert about["metrics"] == dict(run.metrics)


def test_mat_of_a_run(run, run_folder, told, tmp_path):
    file = tmp_path / "run.mat"
    assert told(run_folder, "--data", file)[0] == 0
    names = [name for name, _, _ in whosmat(file)]
    assert all(re.fullmatch(r"[A-Za-z]\w{0,62}", name) for name in names)
    found = loadmat(file)
    for name in run.trace.columns:
        assert found[name].shape == (len(run.trace), 1)
        assert np.array_equal(found[name][:, 0], run.trace[name], equal_nan=True), name
    assert found["surgsim_units"]["tau3_nm"][0, 0] == "nm"
    assert found["surgsim_names"]["tip_x_m"][0, 0] == "tip_x_m"
    assert json.loads(found["surgsim_about"][0])["ending"]["name"] == "completed"


def test_parquet_of_a_run_is_that_of_inspect(run, run_folder, told, tmp_path):
    assert told(run_folder, "--data", tmp_path / "run.parquet")[0] == 0
    table = pq.read_table(tmp_path / "run.parquet")
    assert table.column_names == list(run.trace.columns)
    assert table.schema.field("v1_rad_per_s").metadata[b"unit"] == b"rad_per_s"
    assert json.loads(table.schema.metadata[b"surgsim.trace_meta"])["control_period_s"] == 0.001


def test_names_that_matlab_does_not_take():
    names = ["t_s", "ring/1_m", "ring-1_m", "end", "1st", "x" * 70, "x" * 64]
    found = matlab_names(names)
    assert list(found) == names
    assert found["t_s"] == "t_s"
    assert (found["ring/1_m"], found["ring-1_m"]) == ("ring_1_m", "ring_1_m_2")
    assert (found["end"], found["1st"]) == ("x_end", "x_1st")
    assert found["x" * 64] == "x" * 61 + "_2"
    assert len({*found.values()}) == len(names)


def test_a_batch_has_a_row_for_each_run(made_results, told, tmp_path):
    root = made_results()
    files = [tmp_path / f"batch.{suffix}" for suffix in ("npz", "mat", "parquet")]
    words = [word for file in files for word in ("--data", file)]
    assert told(root, *words)[0] == 0
    given = read_table(root).rows()
    table = pq.read_table(files[2])
    assert table.schema.field("rcm_error_rms_mm").metadata == {
        b"unit": b"mm",
        b"meaning": METRICS["rcm_error_rms_mm"].meaning.encode(),
    }
    with np.load(files[0], allow_pickle=False) as npz:
        mat = loadmat(files[1])
        for name in ("run_id", "outcome"):
            wanted = [row[name] or "" for row in given]
            assert npz[name].tolist() == table[name].to_pylist() == wanted
            assert [cell[0][0] if cell[0].size else "" for cell in mat[name]] == wanted
        for name in ("rcm_error_rms_mm", "success", "seed", "outcome_t_s"):
            wanted = np.array([np.nan if row[name] is None else float(row[name]) for row in given])
            for values in (npz[name], table[name].to_numpy(), mat[name][:, 0]):
                assert np.array_equal(values, wanted, equal_nan=True), name


def test_a_table_of_a_study(told, tmp_path, request):
    folder = request.config.rootpath / RESULTS
    file = tmp_path / "gains.npz"
    assert told(folder, "--study-table", "gains", "--data", file)[0] == 0
    lines = (folder / "gains.csv").read_text(encoding="utf-8").splitlines()
    with np.load(file) as found:
        assert [name for name in found.files if not name.startswith("surgsim_")] == lines[0].split(",")
        assert all(len(found[name]) == len(lines) - 1 for name in lines[0].split(","))
    status, error = told(folder, "--study-table", "gians", "--data", tmp_path / "x.npz")
    assert status == 2
    assert error.endswith("Did you mean 'gains'?\n")


def test_the_same_run_gives_the_same_bytes(run_folder, told, tmp_path, monkeypatch):
    def files(name):
        return [tmp_path / f"{name}.{suffix}" for suffix in ("npz", "mat", "parquet")]

    def write(name):
        assert told(run_folder, *(word for file in files(name) for word in ("--data", file)))[0] == 0

    write("a")
    monkeypatch.setattr("time.asctime", lambda *_: "another day")
    write("b")
    assert [file.read_bytes() for file in files("a")] == [file.read_bytes() for file in files("b")]
