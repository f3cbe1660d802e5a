"""A score: the same everywhere, nothing lost when it is killed, nothing run twice."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tiny_protocol import Here, wish, write_protocol

from surgsim.compare.job import WORKER_DIED, write_failure
from surgsim.compare.workers import Done
from surgsim.errors import SurgsimError
from surgsim.protocol.cells import cells
from surgsim.protocol.freeze import freeze
from surgsim.protocol.reading import read_score, scores_below
from surgsim.protocol.rows import UNREACHABLE, read_rows, row_of, run_cell
from surgsim.protocol.runs import Found, Store, run_key
from surgsim.protocol.score import FILES, PASSPORT, Means, check_out, score, write_score
from surgsim.protocol.seeds import Seeds
from surgsim.scenario.load import load_controller, load_scenario

CELLS = [f"circle/panda/{point}" for point in ("base/0", "base/1", "payload=0.1/0", "payload=10/0")]


def test_a_score_has_a_row_for_each_cell_and_a_scorecard(whole):
    _, made, _ = whole
    assert [row.cell for row in made.rows] == CELLS
    card = made.scorecard
    assert card["runs"] == 4
    assert card["figures"]["completed"]["value"] == card["figures"]["done"]["value"] == 1.0
    (axis,) = card["axes"]
    assert axis["first_failing"] == 2  # 10 kg pull the tip off its path
    assert axis["by_arm"] == {"panda": 2}
    assert made.rows[3].failed
    assert set(made.rows[0].metrics) == {"tip_error_max_mm", "rcm_error_max_mm", "torque_ratio_max"}


def test_what_is_run_again_here_and_now_is_the_same_row(whole):
    protocol, made, _ = whole
    asked = cells(protocol, "nominal", ("panda",), Seeds(), load_controller("joint_impedance"))
    assert run_cell(asked[-1], protocol.config) == made.rows[-1]


def test_killed_and_gone_on_with_two_workers_in_another_folder_home_language_and_zone_it_is_the_same(
    whole, tmp_path
):
    """One test: what takes its time is the start of worker processes."""
    _, made, _ = whole
    home = tmp_path / "another home"
    home.mkdir()
    again = write_protocol(tmp_path)
    freeze(again)
    given = {"HOME": str(home), "TZ": "Asia/Kolkata", "LC_ALL": "de_DE.UTF-8", "LANG": "de_DE.UTF-8"}
    words = ["score", "joint_impedance", "--protocol", str(again.path), "--arms", "panda", "--out", "out"]
    command = [sys.executable, "-m", "surgsim", *words, "--track", "nominal", "--jobs", "2", "--json"]
    place = {
        "cwd": home,
        "env": {**os.environ, **given},
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
    }
    first = subprocess.Popen(command, **place)
    until = time.monotonic() + 100.0
    while not _kept(home) and time.monotonic() < until:
        time.sleep(0.005)
    first.kill()
    first.communicate()
    kept = {path: path.stat().st_mtime_ns for path in _kept(home)}
    assert kept
    second = subprocess.run(command, check=False, text=True, **place)
    assert second.returncode == 0, second.stderr
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    other = json.loads(second.stdout)
    keys = ("protocol_sha256", "rows_sha256", "scorecard_sha256", "scorecard")
    assert {key: other[key] for key in keys} == {
        key: json.loads(json.dumps(made.content[key])) for key in keys
    }
    assert {path.name for path in (home / "out").iterdir()} == FILES
    assert read_score(home / "out").rows == made.rows
    assert not list((home / "runs" / "store").glob("*/.*.part"))


def _kept(home):
    return list((home / "runs" / "store").glob("*/[!.]*/metrics.json"))


def test_unchanged_runs_are_never_run_again(whole):
    protocol, made, store = whole
    runner = Here()
    again = score(wish(protocol), Means(store=store, runner=runner))
    assert runner.count == 0
    assert again.content["scorecard_sha256"] == made.content["scorecard_sha256"]
    track = score(wish(protocol, track="port_tracked"), Means(store=store, runner=runner))
    assert runner.count == 0  # the same runs, on another track
    assert track.content["rows_sha256"] == made.content["rows_sha256"]
    assert track.content["scorecard_sha256"] != made.content["scorecard_sha256"]


def test_after_an_interruption_what_is_missing_is_run_and_nothing_else(whole, tmp_path):
    protocol, made, _ = whole
    store = Store(folder=tmp_path)
    with pytest.raises(KeyboardInterrupt):
        score(wish(protocol), Means(store=store, runner=Here(last=3)))
    rest = Here()
    again = score(wish(protocol), Means(store=store, runner=rest))
    assert rest.count == 1
    assert again.content["scorecard_sha256"] == made.content["scorecard_sha256"]


def test_a_damaged_run_is_run_again(whole, tmp_path):
    protocol, made, _ = whole
    store, runner = Store(folder=tmp_path), Here()
    score(wish(protocol), Means(store=store, runner=runner))
    runs = tmp_path.glob("*/*/metrics.json")
    summary = next(path for path in runs if "completed" in path.read_text(encoding="utf-8"))
    summary.write_text(summary.read_text(encoding="utf-8").replace("completed", "diverged"), encoding="utf-8")
    again = score(wish(protocol), Means(store=store, runner=runner))
    assert runner.count == 5
    assert again.content["rows_sha256"] == made.content["rows_sha256"]


def test_shards_share_the_runs(whole, tmp_path):
    protocol, made, _ = whole
    store, runner = Store(folder=tmp_path), Here()
    assert score(wish(protocol), Means(store=store, runner=runner, shard=(1, 2))) is None
    assert runner.count == 2
    again = score(wish(protocol), Means(store=store, runner=runner, shard=(2, 2)))
    assert runner.count == 4
    assert again.content["scorecard_sha256"] == made.content["scorecard_sha256"]


def test_the_key_of_a_run_follows_scenario_and_code(monkeypatch):
    scenario = load_scenario("circle_panda")
    key = run_key(scenario)
    assert run_key(load_scenario("circle_panda")) == key
    assert run_key(load_scenario("circle_panda", seed=1)) != key
    monkeypatch.setattr("surgsim.protocol.runs.version", lambda name: "0")
    assert run_key(scenario) != key


def test_a_run_that_lost_its_worker_is_told_and_tried_again(whole, tmp_path):
    protocol, made, _ = whole
    store = Store(folder=tmp_path)

    def dying(jobs, _):
        for index, job in enumerate(jobs):
            write_failure(job.scenario(), Path(job.folder), WORKER_DIED, "exit code 9")
            yield Done(index=index, outcome=WORKER_DIED)

    lost = score(wish(protocol), Means(store=store, runner=dying))
    assert lost.broken == CELLS
    assert lost.scorecard["failures"] == {"worker_died": 4}
    again = score(wish(protocol), Means(store=store, runner=Here()))
    assert again.broken == []
    assert again.content["scorecard_sha256"] == made.content["scorecard_sha256"]


def test_a_drawn_port_that_nobody_reaches_counts_for_nobody(whole):
    protocol, _, _ = whole
    cell = cells(protocol, "nominal", ("panda",), Seeds(), load_controller("pinv"))[0]
    far = load_scenario(cell.scenario, assignments=["trocar.position_m=[2.0, 0.0, 0.2]"])
    lost = run_cell(type(cell)(generator="circle", arm="panda", seed=0, scenario=far), protocol.config)
    assert (lost.outcome, lost.counts) == (UNREACHABLE, False)


def test_a_controller_that_refuses_a_scenario_has_failed_it(whole):
    protocol, _, _ = whole
    cell = cells(protocol, "nominal", ("panda",), Seeds(), load_controller("pinv"))[0]
    refused = type(cell)(generator="circle", arm="panda", seed=0, scenario=None, refusal="it does not fit")
    row = row_of(Found(cell=refused, key="", summary=None), protocol.config)
    assert (row.outcome, row.counts, row.failed) == ("refused", True, True)


def test_a_score_is_read_back_and_an_edited_one_is_refused(whole, tmp_path):
    _, made, _ = whole
    write_score(tmp_path, made)
    assert read_score(tmp_path).rows == made.rows
    assert [each.name for each in scores_below(tmp_path)] == ["joint_impedance"]
    assert read_rows(tmp_path / "rows.jsonl") == list(made.rows)
    rows = tmp_path / "rows.jsonl"
    rows.write_text(
        rows.read_text(encoding="utf-8").replace('"completed"', '"diverged"', 1), encoding="utf-8"
    )
    with pytest.raises(SurgsimError, match=r"rows.jsonl is not that of rows_sha256"):
        read_score(tmp_path)
    write_score(tmp_path, made)
    content = json.loads((tmp_path / "score.json").read_text(encoding="utf-8"))
    content["scorecard"]["figures"]["done"]["value"] = 2.0
    (tmp_path / "score.json").write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(SurgsimError, match="its scorecard is not that of scorecard_sha256"):
        read_score(tmp_path)


def test_another_folder_is_never_overwritten(whole, tmp_path):
    _, made, _ = whole
    write_score(tmp_path / "a", made)
    check_out(tmp_path / "a", resume=True)
    with pytest.raises(SurgsimError, match="holds a score; give --resume to make it again"):
        check_out(tmp_path / "a", resume=False)
    (tmp_path / "a" / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(SurgsimError, match=r"holds 'notes.txt', which is not a score's"):
        check_out(tmp_path / "a", resume=True)
    with pytest.raises(SurgsimError, match="is a file; --out names a folder"):
        check_out(tmp_path / "a" / "notes.txt", resume=True)


def test_times_are_beside_the_score_not_in_it(whole):
    _, made, _ = whole
    assert made.timing["runs"] == 4
    assert np.isfinite(made.timing["control_time_p50_us"]["mean"])
    told = json.dumps(made.content["scorecard"])
    assert "control_time" not in told
    assert "wall" not in told


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ["rcm_inverse_dynamics", "--track", "nominal"],
            "may not enter track 'nominal': it reads port: tracking",
        ),
        (["pinvv"], "'pinvv' is not a shipped controller or policy"),
        (["pinv", "--track", "x"], "--track: 'x' is not a track"),
        (["pinv", "--seeds", "2027-1"], "'2027-1' is no round of surgsim_v1"),
        (["pinv", "--shard", "3/2"], "--shard: '3/2' is not I/N"),
        (["pinv", "--scheme", "tank"], "--scheme: 'tank' is not a scheme. Known: none."),
        (["pinv", "--protocol", "x"], "'x' is not a protocol"),
        (["pinv", "--all"], "--all scores the protocol's own entries"),
        (["pinv", "--beside", "nowhere"], "nowhere holds no score"),
        ([], "give a controller, --external NAME=COMMAND, or --all"),
    ],
)
def test_what_cannot_be_scored_is_told_on_one_line(warm, words, told, tmp_path):
    done = warm.run(["score", *words], folder=tmp_path)
    assert done.returncode == 2
    assert told in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_the_passport_is_written_beside_the_score(warm, whole, tmp_path):
    protocol, made, store = whole
    words = ["score", "joint_impedance", "--protocol", str(protocol.path), "--arms", "panda"]
    done = warm.run([*words, "--store", str(store.folder), "--out", str(tmp_path / "a")], folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "1 of 4 runs failed" in done.stdout
    assert {name for name in PASSPORT if (tmp_path / "a" / name).stat().st_size > 1000} == set(PASSPORT)
    assert read_score(tmp_path / "a").content["scorecard_sha256"] == made.content["scorecard_sha256"]


def test_a_program_outside_is_scored_and_told_by_what_it_declares(scored):
    made = scored("external_torque")
    told = made.content["controller"]
    assert set(told["externals"]) == {"mine"}
    assert told["externals"]["mine"]["version"]
    assert all(row.outcome in ("completed", "velocity_limit", "patient_collision") for row in made.rows)
