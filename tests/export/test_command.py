"""What `surgsim export` takes, refuses and leaves."""

import json
from pathlib import Path

import pytest

from surgsim.errors import SurgsimError
from surgsim.export.subjects import BatchSubject, RunSubject, StudySubject, find


def test_a_wrong_suffix_names_those_there_are(run_folder, told, tmp_path):
    status, error = told(run_folder, "--data", tmp_path / "run.xlsx")
    assert (status, error) == (
        2,
        f"surgsim: --data {tmp_path}/run.xlsx: '.xlsx' is not known. Allowed: .mat, .npz, .parquet.\n",
    )
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_there_is_kept_without_force(run_folder, told, tmp_path):
    file = tmp_path / "run.npz"
    file.write_text("precious")
    status, error = told(run_folder, "--data", tmp_path / "other.npz", "--data", file)
    assert (status, error) == (2, f"surgsim: --data {file}: is there already; --force replaces it\n")
    assert file.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [file]
    assert told(run_folder, "--data", file, "--force")[0] == 0
    assert file.read_bytes()[:2] == b"PK"


def test_nothing_half_written_is_left(run_folder, told, tmp_path, monkeypatch):
    file = tmp_path / "run.mat"

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("surgsim.recording.files.os.replace", full)
    status, error = told(run_folder, "--data", file)
    assert (status, error) == (2, f"surgsim: {file}: cannot be written: No space left on device\n")
    assert list(tmp_path.iterdir()) == []


def test_a_run_without_recording_says_so_in_one_line(unrecorded, told, tmp_path):
    status, error = told(unrecorded, "--data", tmp_path / "run.npz")
    assert status == 2
    assert error == (
        f"surgsim: {unrecorded}: a run without recording: its metrics are there, its trace is not. "
        f"To record it: surgsim run {unrecorded}/scenario.yaml --out DIR\n"
    )


def test_names_below_the_usual_folders(run_folder, made_results, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for place, target in (("runs/circle/one", run_folder), ("runs/suites/quick", made_results())):
        Path(place).parent.mkdir(parents=True, exist_ok=True)
        Path(place).symlink_to(target)
    assert isinstance(find("circle/one"), RunSubject)
    assert isinstance(find("circle"), RunSubject)  # the only one
    assert isinstance(find("quick"), BatchSubject)
    Path("runs/circle/two").symlink_to(run_folder)
    with pytest.raises(SurgsimError, match=r"a folder of 2 runs: runs/circle/one, runs/circle/two\. Name"):
        find("circle")
    with pytest.raises(SurgsimError, match="'quik' is neither a path nor the name of a run, a batch or a"):
        find("quik")
    with pytest.raises(SurgsimError, match="holds neither a run, a batch nor a study"):
        find(str(tmp_path))


def test_a_lone_recording_and_a_study(run, run_folder, request):
    alone = find(str(run_folder / "recording.rrd"))
    assert isinstance(alone, RunSubject)
    assert (
        (alone.label, alone.outcome)
        == (run.label, "completed")
        == ("circle_lwr4plus, pinv, seed 3", "completed")
    )
    study = find(str(request.config.rootpath / "results" / "vprnn"))
    assert isinstance(study, StudySubject)
    assert study.tables[0] == "comparison"


def test_a_run_of_a_batch_that_is_not_there(made_results, run_folder, told, tmp_path):
    out = ("--data", tmp_path / "x.npz")
    status, error = told(made_results(), "--run", "nobody", *out)
    assert status == 2
    assert "'nobody' is not a run of " in error
    assert told(run_folder, "--run", "nobody", *out) == (
        2,
        "surgsim: --run names runs of one batch: give the folder of that alone\n",
    )


def test_json_lists_the_files(run_folder, tmp_path, capsys):
    from surgsim.cli.main import main

    file = tmp_path / "run.npz"
    assert main(["export", str(run_folder), "--data", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == [{"file": str(file), "bytes": file.stat().st_size}]
