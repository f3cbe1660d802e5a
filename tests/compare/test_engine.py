"""A batch: the whole table, whatever happens on the way to it."""

import errno
import json
import multiprocessing
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from batches import Here, short_run

from surgsim.compare.engine import Batch, compare
from surgsim.compare.job import DiskError
from surgsim.compare.suite import SuiteConfig
from surgsim.compare.table import MACHINE_COLUMNS, read_table
from surgsim.compare.unfinished import has_table
from surgsim.compare.workers import run_jobs
from surgsim.errors import SurgsimError
from surgsim.recording.contents import fault_of
from surgsim.recording.sealed import read_sealed, sealed

SHORT = short_run()
SUITE = SuiteConfig(
    name="small",
    scenarios=("circle_lwr4plus",),
    controllers=("vprnn", "pinv"),
    grid={"disturbances": ([], [{"type": "payload", "mass_kg": 0.5, "spread": 0.5}])},
    seeds="0:2",
    settings=SHORT,
)
SCRIPT = """
import json, sys
from pathlib import Path
from surgsim.compare.engine import Batch, compare
from surgsim.compare.suite import SuiteConfig
from surgsim.errors import SurgsimError
from surgsim.recording.sealed import read_sealed, sealed

if __name__ == "__main__":
    suite = SuiteConfig.model_validate_json(sys.argv[1])
    out, jobs, resume = Path(sys.argv[2]), int(sys.argv[3]), "resume" in sys.argv
    batch = Batch(suite=suite, folder=Path(), out=out, jobs=jobs, resume=resume)
    try:
        compare(batch)
    except SurgsimError as error:
        sys.exit(str(error))
"""


def batch(out, **changes):
    return replace(Batch(suite=SUITE, folder=Path(), out=out), **changes)


def stopping_after(most):
    """A runner that is interrupted after `most` jobs."""

    def run(jobs, count):
        for done in Here()(jobs, count):
            if done.index >= most:
                raise KeyboardInterrupt
            yield done

    return run


def same(a, b):
    """Whether two tables are equal bit for bit but for what measures the machine."""
    kept = [repr(table.without(MACHINE_COLUMNS)) for table in (a, b)]
    return kept[0] == kept[1]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Folder of the uninterrupted batch."""
    out = tmp_path_factory.mktemp("whole") / "results"
    compare(batch(out), runner=Here())
    return out


@pytest.fixture
def copy(whole, tmp_path):
    """A copy of the uninterrupted batch that may be spoilt."""
    return shutil.copytree(whole, tmp_path / "copy")


def test_the_whole_table(whole):
    table = read_table(whole)
    assert len(table) == 8
    rows = table.rows()
    parameters = [
        '{"disturbances": []}',
        '{"disturbances": [{"mass_kg": 0.5, "spread": 0.5, "type": "payload"}]}',
    ]
    assert [(row["controller"], row["parameters"], row["seed"]) for row in rows] == [
        (controller, point, seed)
        for controller in ("vprnn", "pinv")
        for point in parameters
        for seed in (0, 1)
    ]
    assert {row["outcome"] for row in rows} == {"completed"}
    assert len({row["run_id"] for row in rows}) == 8
    for row in rows:
        assert row["folder"] == f"runs/{row['run_id']}"
        summary = json.loads((whole / row["folder"] / "metrics.json").read_text())
        assert summary["metrics"]["tip_error_rms_mm"] == row["tip_error_rms_mm"]
        assert (row["suite"], row["recording"]) == ("small", None)
    errors = [row["tip_error_rms_mm"] for row in rows if row["controller"] == "vprnn"]
    assert errors[0] == errors[1], "without a disturbance the seed makes no difference"
    assert len(set(errors)) == 3
    about = json.loads((whole / "suite.json").read_text())
    assert about["schema_version"] == 1
    assert (about["name"], about["controllers"], about["seeds"]) == ("small", ["vprnn", "pinv"], "0:2")
    assert {"surgsim", "python", "packages", "machine", "commit"} <= set(about["provenance"])


def test_what_is_whole_is_kept_and_what_is_missing_is_run(whole, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        compare(batch(out), runner=stopping_after(3))
    assert not (out / "runs.csv").exists()
    made = {path.parent: path.stat().st_mtime_ns for path in out.glob("runs/*/*/[!.]*/metrics.json")}
    assert len(made) == 4, "the fourth was written, its answer never read"
    runner, seen = Here(), []
    table = compare(batch(out, resume=True), lambda *now: seen.append(now), runner)
    assert len(runner.folders) == 4
    assert not {Path(folder) for folder in runner.folders} & set(made)
    assert seen == [(done, 8, "completed") for done in (5, 6, 7, 8)]
    assert all((folder / "metrics.json").stat().st_mtime_ns == when for folder, when in made.items())
    assert same(table, read_table(whole))


def test_a_batch_that_is_gone_on_with_is_unfinished_until_it_is_whole(tmp_path):
    out = tmp_path / "out"
    compare(batch(out), runner=Here())
    assert has_table(out)
    (folder, *_) = (path.parent for path in out.glob("runs/*/*/[!.]*/metrics.json"))
    spoil_json(folder)
    with pytest.raises(KeyboardInterrupt):
        compare(batch(out, resume=True), runner=stopping_after(0))
    assert not has_table(out)
    compare(batch(out, resume=True), runner=Here())
    assert has_table(out)


def spoil_json(folder):
    text = (folder / "metrics.json").read_text()
    (folder / "metrics.json").write_text(text[: len(text) // 2])


def empty_scenario(folder):
    (folder / "scenario.yaml").write_bytes(b"")


def change_a_letter(folder):
    text = (folder / "scenario.yaml").read_text()
    (folder / "scenario.yaml").write_text(text.replace("vprnn", "vprnm", 1))


def lose_scenario(folder):
    (folder / "scenario.yaml").unlink()


def lose_file(folder):
    (folder / "metrics.json").unlink()


def lose_folder(folder):
    shutil.rmtree(folder)


def change(folder, key, value):
    summary = read_sealed(folder / "metrics.json")
    summary["provenance"][key] = value
    summary["metrics"]["tip_error_rms_mm"] = 1e9
    (folder / "metrics.json").write_text(json.dumps(sealed(summary)))


def lose_key(folder, key):
    summary = read_sealed(folder / "metrics.json")
    del summary["provenance"][key]
    (folder / "metrics.json").write_text(json.dumps(sealed(summary)))


def test_other_code_is_named(copy, whole, capsys):
    folder = copy / read_table(whole)["folder"][2]
    provenance = read_sealed(folder / "metrics.json")["provenance"]
    change(folder, "packages", {**provenance["packages"], "mujoco": "3.0.0", "rerun-sdk": "0.1"})
    change(folder, "code_sha256", "0" * 64)
    compare(batch(copy, resume=True), runner=Here())
    now = provenance["packages"]["mujoco"]
    count = len(read_table(whole))
    told = f"1 of {count} runs were made by other code (mujoco 3.0.0 not {now}) and are run again"
    assert capsys.readouterr().err == f"surgsim: {told}\n"


@pytest.mark.parametrize(
    "spoil",
    [
        spoil_json,
        empty_scenario,
        change_a_letter,
        lose_scenario,
        lose_file,
        lose_folder,
        lambda folder: change(folder, "code_sha256", "0" * 64),
        lambda folder: lose_key(folder, "code_sha256"),
        lambda folder: change(folder, "scenario_sha256", "0" * 64),
    ],
    ids=[
        "half a file",
        "empty scenario",
        "changed scenario",
        "no scenario",
        "no file",
        "no folder",
        "other code",
        "no word of the code",
        "another scenario",
    ],
)
def test_what_is_not_whole_or_not_of_this_code_is_run_again(copy, whole, spoil):
    folder = copy / read_table(whole)["folder"][2]
    spoil(folder)
    runner = Here()
    table = compare(batch(copy, resume=True), runner=runner)
    assert runner.folders == [str(folder)]
    assert same(table, read_table(whole))


def test_what_a_killed_run_left_is_neither_counted_nor_kept(copy, whole):
    folder = copy / read_table(whole)["folder"][5]
    draft = folder.parent / f".{folder.name}.abc.part"
    folder.rename(draft)
    (copy / ".suite.json.x.partial").write_text("half")
    (copy / ".runs.csv.x.partial").write_text("half")
    runner = Here()
    table = compare(batch(copy, resume=True), runner=runner)
    assert runner.folders == [str(folder)]
    assert same(table, read_table(whole))
    assert not [path for path in copy.rglob(".*")]


def test_a_run_that_is_kept_is_read_once(copy, monkeypatch):
    seen = []

    def counted(folder, summary):
        seen.append(folder)
        return fault_of(folder, summary)

    monkeypatch.setattr("surgsim.compare.engine.fault_of", counted)
    compare(batch(copy, resume=True), runner=Here())
    assert sorted(seen) == sorted(copy / row["folder"] for row in read_table(copy).rows())


def test_a_recording_that_is_wanted_and_missing_is_made(tmp_path):
    suite = SUITE.model_copy(update={"controllers": ("pinv",), "grid": {}, "seeds": "0"})
    out = tmp_path / "out"
    first = compare(batch(out, suite=suite), runner=Here())
    second = compare(batch(out, suite=suite.model_copy(update={"record": True}), resume=True), runner=Here())
    assert first["recording"] == (None,)
    recording = second["recording"][0]
    assert recording == "runs/circle_lwr4plus/pinv/base-seed0/recording.rrd"
    assert (out / recording).is_file()
    wanted = batch(out, suite=suite.model_copy(update={"record": True}), resume=True)
    runner = Here()
    compare(wanted, runner=runner)
    assert runner.folders == []
    content = (out / recording).read_bytes()
    for damaged in (b"", content[:-1], content[:-1] + bytes([content[-1] ^ 1])):
        (out / recording).write_bytes(damaged)
        runner = Here()
        compare(wanted, runner=runner)
        assert runner.folders == [str((out / recording).parent)]


def test_runs_that_cannot_start_are_rows(tmp_path):
    grid = {"task.radius_m": (0.002, 0.2)}
    suite = SUITE.model_copy(update={"controllers": None, "grid": grid, "seeds": "0"})
    rows = compare(batch(tmp_path / "out", suite=suite), runner=Here()).rows()
    assert [row["outcome"] for row in rows] == ["completed", "refused"]
    assert rows[1]["outcome_detail"].startswith("circle_lwr4plus: at t = ")
    assert (rows[1]["tip_error_rms_mm"], rows[1]["outcome_t_s"]) == (None, 0.0)
    runner = Here()
    compare(batch(tmp_path / "out", suite=suite, resume=True), runner=runner)
    assert runner.folders == [], "a refused run is whole"


def test_shards_merge_to_the_same_table(whole, tmp_path):
    out = tmp_path / "out"
    folders = []
    for i in (3, 1, 2):
        runner = Here()
        table = compare(batch(out, shard=(i, 3)), runner=runner)
        assert (table is None) == (i != 2), "the last to end makes the table"
        folders += runner.folders
    assert len(folders) == len(set(folders)) == 8
    assert same(table, read_table(whole))
    runner = Here()
    assert same(compare(batch(out, resume=True), runner=runner), table)
    assert runner.folders == []


def test_resuming_after_some_shards_runs_the_rest(whole, tmp_path):
    out, runner = tmp_path / "out", Here()
    assert compare(batch(out, shard=(1, 3)), runner=Here()) is None
    table = compare(batch(out, resume=True), runner=runner)
    assert len(runner.folders) == 5
    assert same(table, read_table(whole))


def test_a_shard_that_begins_while_another_makes_the_folder_is_not_refused(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / ".suite.json.other.part").write_text("half writ")
    assert compare(batch(out, shard=(2, 8)), runner=Here()) is None
    assert (out / ".suite.json.other.part").exists(), "it is the other shard's"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, "{out} holds results; give --resume to go on with them, or another --out"),
        (
            {"resume": True, "suite": SUITE.model_copy(update={"seeds": "0:3"})},
            "{out} holds the results of another suite, or of other settings",
        ),
        (
            {"shard": (1, 2), "suite": SUITE.model_copy(update={"settings": SHORT[1:]})},
            "{out} holds the results of another suite, or of other settings",
        ),
    ],
)
def test_results_that_are_there_are_not_overwritten(copy, whole, changes, message):
    with pytest.raises(SurgsimError) as error:
        compare(batch(copy, **changes), runner=Here())
    assert str(error.value) == message.format(out=copy)
    assert same(read_table(copy), read_table(whole))


def test_a_foreign_folder_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(SurgsimError) as error:
        compare(batch(tmp_path, resume=True), runner=Here())
    assert str(error.value) == f"{tmp_path} holds files that are not batch results; choose another --out"
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize("text", ["{half", "[1]"])
def test_a_damaged_suite_json_is_refused(copy, text):
    (copy / "suite.json").write_text(text)
    with pytest.raises(SurgsimError) as error:
        compare(batch(copy, resume=True), runner=Here())
    assert str(error.value).startswith(f"{copy / 'suite.json'} is damaged: ")


def test_an_out_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(SurgsimError) as error:
        compare(batch(tmp_path / "out"), runner=Here())
    assert str(error.value) == f"cannot write {tmp_path / 'out'}: File exists"


def test_two_runs_of_one_name_are_refused(tmp_path):
    suite = SUITE.model_copy(update={"controllers": ("vprnn", "vprnn")})
    with pytest.raises(SurgsimError) as error:
        compare(batch(tmp_path / "out", suite=suite), runner=Here())
    assert str(error.value).startswith("two runs of the suite are both 'circle_lwr4plus/vprnn/")
    assert str(error.value).endswith("-seed0': give scenarios and controllers different names")
    assert not (tmp_path / "out").exists()


def test_a_full_disk_is_an_error_and_the_rest_can_be_run_later(whole, tmp_path, monkeypatch):
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        real, count = os.rename, []

        def rename(source, target):
            count.append(target)
            if len(count) > 3:
                raise OSError(errno.ENOSPC, "No space left on device")
            real(source, target)

        patch.setattr("surgsim.runs.exchange.os.rename", rename)
        with pytest.raises(DiskError, match="No space left on device"):
            compare(batch(out), runner=Here())
    assert len(list(out.glob("runs/*/*/[!.]*/metrics.json"))) == 3
    assert not list(out.rglob(".*.part"))
    assert same(compare(batch(out, resume=True), runner=Here()), read_table(whole))


def test_a_disk_that_is_full_when_the_table_is_written(copy, whole, monkeypatch):
    (copy / "runs.csv.sha256").unlink()
    real = os.replace

    def refuse(source, target):
        if Path(target).name == "runs.csv.sha256":
            raise OSError(errno.ENOSPC, "No space left on device")
        real(source, target)

    with monkeypatch.context() as patch:
        patch.setattr("surgsim.recording.files.os.replace", refuse)
        with pytest.raises(SurgsimError) as error:
            compare(batch(copy, resume=True), runner=Here())
    assert str(error.value) == f"{copy / 'runs.csv.sha256'}: cannot be written: No space left on device"
    assert sorted(path.name for path in copy.iterdir()) == ["runs", "runs.csv", "runs.parquet", "suite.json"]
    assert same(compare(batch(copy, resume=True), runner=Here()), read_table(whole))


def test_kill_9_of_one_worker_changes_nothing(whole, tmp_path):
    killed = []

    def kill_one(done, count, outcome):
        if done == 2:
            child = random.choice(multiprocessing.active_children())
            killed.append(child.pid)
            os.kill(child.pid, signal.SIGKILL)

    table = compare(batch(tmp_path / "out", jobs=2), kill_one, run_jobs)
    assert len(killed) == 1
    assert same(table, read_table(whole))


def start(script, out, suite=SUITE):
    command = [sys.executable, "-W", "error", str(script), suite.model_dump_json(), str(out), "2"]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


def wait_for(condition, seconds=90.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.005)


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_kill_9_of_the_whole_command_at_a_random_moment(whole, tmp_path):
    script, out = tmp_path / "script.py", tmp_path / "out"
    script.write_text(SCRIPT)
    draw = random.Random()
    runs, delay_s = draw.randint(1, 4), draw.uniform(0.0, 0.3)
    command = start(script, out)
    with command:
        wait_for(lambda: len(list(out.glob("runs/*/*/[!.]*/metrics.json"))) >= runs)
        time.sleep(delay_s)
        family = Path(f"/proc/{command.pid}/task/{command.pid}/children").read_text(encoding="utf-8").split()
        command.kill()
    wait_for(lambda: not any(alive(pid) for pid in family), 30.0)
    print(f"killed with {runs} runs whole, {delay_s:.3f} s later")
    kept = {path: path.stat().st_mtime_ns for path in out.glob("runs/*/*/[!.]*/metrics.json")}
    runner = Here()
    table = compare(batch(out, resume=True), runner=runner)
    assert len(runner.folders) == 8 - len(kept)
    assert all(path.stat().st_mtime_ns == when for path, when in kept.items())
    assert same(table, read_table(whole))
    assert not list(out.rglob(".*"))


@pytest.mark.slow
@pytest.mark.needs("mount")
def test_a_disk_that_is_really_full(whole, tmp_path):
    """On a disk of 40 KiB, made larger for the second call."""
    script, disk = tmp_path / "script.py", tmp_path / "disk"
    script.write_text(SCRIPT)
    disk.mkdir()
    shell = (
        'mount -t tmpfs -o size=40k tmpfs "$1" && "$2" "$3" "$4" "$1/out" 1 2> "$5/said"; '
        'mount -o remount,size=4m "$1" && "$2" "$3" "$4" "$1/out" 1 resume && cp -r "$1/out" "$5/out"'
    )
    arguments = [disk, sys.executable, script, SUITE.model_dump_json(), tmp_path]
    done = subprocess.run(
        ["unshare", "-rm", "sh", "-c", shell, "sh", *map(str, arguments)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    said = (tmp_path / "said").read_text()
    assert said.startswith(f"cannot write {disk}/out/runs/circle_lwr4plus/")
    assert said.endswith(": No space left on device; what is whole stays, --resume goes on with the rest\n")
    assert same(read_table(tmp_path / "out"), read_table(whole))
