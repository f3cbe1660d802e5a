"""`surgsim tune`: short searches from end to end, going on with one, and what is refused."""

import contextlib
import json
import multiprocessing
import signal
from pathlib import Path

import pytest
from batches import Here, short_run

from surgsim.cli.main import main
from surgsim.metrics.catalog import evaluate
from surgsim.recording.sealed import read_sealed
from surgsim.runs.stop import Stopped
from surgsim.scenario.load import load_controller, load_experiment
from surgsim.simulate.loop import simulate

LOAD = "disturbances=[{type: payload, mass_kg: 0.4, spread: 0.5}]"
SETTINGS = [word for setting in (*short_run(0.25), LOAD) for word in ("--set", setting)]
TUNE = ["tune", "rcm_inverse_dynamics", "--scenario", "circle_lwr4plus", *SETTINGS]
SMALL = [*TUNE, "--keys", "torque_law.rcm_stiffness_per_s2,resolver.k_tip", "--seeds", "1000:1002"]
FILE = "rcm_inverse_dynamics_tuned.yaml"


class Once(Here):
    """Does jobs in this process; after so many it is interrupted."""

    def __init__(self, most=10**9):
        super().__init__()
        self.most = most

    def run(self, jobs):
        for done in self(jobs, 1):
            if len(self.folders) > self.most:
                raise Stopped(signal.SIGINT)
            yield done

    @contextlib.contextmanager
    def kept(self, count):
        yield self.run


@pytest.fixture
def here(monkeypatch, tmp_path):
    """Factory of what does the runs from now on, in this process and in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def use(most=10**9):
        runner = Once(most)
        monkeypatch.setattr("surgsim.compare.workers.kept_workers", runner.kept)
        return runner

    return use


def lines(folder):
    return [json.loads(line) for line in (Path(folder) / "evaluations.jsonl").read_text().splitlines()]


def summary(folder):
    return read_sealed(Path(folder) / "tuning.json")


def test_a_short_tuning_leaves_a_controller_that_runs_and_says_where_it_comes_from(here, capsys):
    runner = here()
    assert main([*SMALL, "--budget", "7"]) == 0
    printed = capsys.readouterr()
    folder = Path("runs/tuned/rcm_inverse_dynamics")
    assert sorted(path.name for path in folder.iterdir()) == ["evaluations.jsonl", FILE, "tuning.json"]
    found = summary(folder)
    assert (found["finished"], found["runs"], found["candidates"]) == (True, 6, 3)
    assert [line["candidate"] for line in lines(folder)][:6] == [0, 0, 1, 1, 2, 2]
    assert len(lines(folder)) == len(runner.folders) == 6 + found["margins"]["runs"]
    assert {line["extra_delay_s"] for line in lines(folder)[:6]} == {0.0}
    assert max(line["extra_delay_s"] for line in lines(folder)) == pytest.approx(0.05)
    assert {line["seed"] for line in lines(folder)} == {1000, 1001}
    assert not any(Path(run).exists() for run in runner.folders)

    head = [line for line in (folder / FILE).read_text().splitlines() if line.startswith("#")]
    assert "# scenarios: circle_lwr4plus" in head
    assert "# tuning seeds: 1000:1002 (evaluate with others)" in head
    assert any(line.startswith("# budget: 7 runs, 6 taken, 3 candidates") for line in head)
    assert any(line.startswith("# gain margin: ") for line in head)
    assert any(line.startswith("# surgsim 0.") and "commit" in line for line in head)
    controller = load_controller(str(folder / FILE))
    assert controller.name == "rcm_inverse_dynamics_tuned"
    assert (
        controller.torque_law.rcm_stiffness_per_s2
        == found["gains"]["torque_law.rcm_stiffness_per_s2"]["after"]
    )
    assert controller.torque_law.tip_stiffness_per_s2 == 1e4

    for name in ("rcm_error_rms_mm", "tip_error_rms_mm", "failed_runs"):
        assert any(name in line for line in printed.out.splitlines())
    assert "delay margin: " in printed.out
    assert "tuning rcm_inverse_dynamics: 6 of 6 runs" in printed.err


def test_one_controller_is_tuned_for_all_arms_of_a_scenario(here, capsys):
    here()
    task = {"duration_s": 0.25, "ramp_s": 0.1, "hold_start_s": 0.0, "hold_end_s": 0.0, "radius_m": 0.002}
    words = [f"arms.{k}.task.{key}={value}" for k in (0, 1) for key, value in task.items()]
    settings = [word for setting in ("theatre=false", *words) for word in ("--set", setting)]
    tune = ["tune", "rcm_inverse_dynamics", "--scenario", "two_ports_panda", *settings, "--seeds", "1000"]
    assert main([*tune, "--keys", "torque_law.rcm_stiffness_per_s2", "--budget", "3", "--out", "t"]) == 0
    assert "left_rcm_error_rms_mm" in capsys.readouterr().out
    found = summary("t")
    after = found["gains"]["torque_law.rcm_stiffness_per_s2"]["after"]
    assert found["candidates"] == 3
    assert found["margins"]["delay_s"] is not None
    of_arms = {
        f"{arm}_{name}" for arm in ("left", "right") for name in ("rcm_error_rms_mm", "tip_error_rms_mm")
    }
    assert of_arms <= set(lines("t")[0]["metrics"])
    scenario = load_experiment("two_ports_panda", controller=f"t/{FILE}", assignments=words, seed=1000)
    assert [arm.controller.torque_law.rcm_stiffness_per_s2 for arm in scenario.arms] == [after, after]
    metrics = evaluate(simulate(scenario)).values
    for name in of_arms:
        assert found["metrics"]["two_ports_panda"]["after"][name] == pytest.approx(metrics[name], rel=1e-9)
    assert main([*tune, "--budget", "3", "--set", "arms.1.controller=pinv", "--out", "u"]) == 2
    assert "arms.1.controller=pinv: the controller is the command's first argument" in capsys.readouterr().err


def test_what_is_reported_is_what_the_written_file_gives(here, capsys):
    here()
    assert main([*SMALL, "--budget", "8", "--json", "--out", "t"]) == 0
    found = json.loads(capsys.readouterr().out)
    told = found["metrics"]["circle_lwr4plus"]["after"]
    errors = []
    for seed in ("1000", "1001"):
        again = ["run", "circle_lwr4plus", "--controller", f"t/{FILE}", "--seed", seed, *SETTINGS]
        assert main([*again, "--no-record", "--json"]) == 0
        errors.append(json.loads(capsys.readouterr().out)["metrics"]["rcm_error_rms_mm"])
    assert told["rcm_error_rms_mm"] == pytest.approx(sum(errors) / 2, rel=1e-12)
    assert told["failed_runs"] == 0
    assert found["cost"]["after"] <= found["cost"]["before"]
    for value in found["gains"].values():
        assert value["after"] == value["before"] or value["after"] == float(f"{value['after']:.2e}")


def test_an_interrupted_tuning_leaves_the_best_so_far_and_is_gone_on_with(here, capsys):
    here(most=5)
    assert main([*SMALL, "--budget", "8", "--out", "parts"]) == 130
    assert "surgsim: interrupted; the best so far is in parts" in capsys.readouterr().err
    first = summary("parts")
    assert (first["finished"], first["runs"], first["margins"]) == (False, 2, None)
    assert "# interrupted" in Path("parts", FILE).read_text(encoding="utf-8")
    assert len(lines("parts")) == 5
    with Path("parts", "evaluations.jsonl").open("a", encoding="utf-8") as file:
        file.write('{"candidate": 3, "ga')  # as a killed process leaves it

    rest = here()
    assert main([*SMALL, "--budget", "8", "--out", "parts", "--resume"]) == 0
    whole = here()
    assert main([*SMALL, "--budget", "8", "--out", "whole"]) == 0
    assert summary("parts") == summary("whole")
    assert Path("parts", FILE).read_text(encoding="utf-8") == Path("whole", FILE).read_text(encoding="utf-8")
    assert len(rest.folders) == len(whole.folders) - 5
    nothing = here()
    assert main([*SMALL, "--budget", "8", "--out", "whole", "--resume"]) == 0
    assert nothing.folders == []
    assert summary("parts") == summary("whole")


def test_runs_of_other_code_are_run_again(here):
    here()
    assert main([*SMALL, "--budget", "4", "--out", "t"]) == 0
    file = Path("t/evaluations.jsonl")
    old = lines("t")
    file.write_text(
        "".join(json.dumps({**line, "code_sha256": "0" * 64}) + "\n" for line in old), encoding="utf-8"
    )
    again = here()
    assert main([*SMALL, "--budget", "4", "--out", "t", "--resume"]) == 0
    assert len(again.folders) == len(old)


def test_processes_do_not_change_the_result(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    for jobs in ("1", "2"):
        assert main([*SMALL, "--budget", "6", "--jobs", jobs, "--out", f"jobs{jobs}"]) == 0
    assert summary("jobs1") == summary("jobs2")
    assert Path("jobs1", FILE).read_text(encoding="utf-8") == Path("jobs2", FILE).read_text(encoding="utf-8")
    assert multiprocessing.active_children() == []


def test_a_start_that_fails_is_told_and_has_no_margins(here, capsys):
    here()
    strict = ["--set", "safety.tip_error_max_m=1e-9", "--budget", "4", "--out", "t"]
    assert main([*SMALL, *strict]) == 0
    found = summary("t")
    assert found["metrics"]["circle_lwr4plus"]["after"] == {"failed_runs": 2}
    assert found["cost"]["before"] > 2000
    assert (found["margins"]["delay_s"], found["margins"]["gain_factor"]) == (None, None)
    assert "delay margin: none" in capsys.readouterr().out


REFUSED = {
    "--budget 3": "--budget: 3 is not allowed: must be 4 or more",
    "--budget 0": "--budget: 0 is not allowed",
    "--budget -5": "--budget: -5 is not allowed",
    "--budget 9 --keys torque_law.rcm_stifness_per_s2": "Did you mean 'torque_law.rcm_stiffness_per_s2'?",
    "--budget 9 --seeds a": "--seeds: 'a' is not a list of seeds",
    "--budget 9 --seed -1": "--seed: -1 is not allowed: must be 0 to 4294967295",
    "--budget 9 --set seed=3": "the seeds of the runs are given by --seeds",
    "--budget 9 --set controller=pinv": "the controller is the command's first argument",
    "--budget 9 --scenario circle_lwr4plus": "two scenarios are both 'circle_lwr4plus'",
    "--budget 9 --scenario circle_lwr5": "'circle_lwr5' is not a shipped scenario",
    "--budget 9 --jobs 0": "--jobs: 0 is not allowed",
    "--budget 9 --out /dev/null": "cannot write /dev/null: File exists",
}


@pytest.mark.parametrize("words", REFUSED)
def test_wrong_words_are_refused_in_one_line(here, capsys, words):
    runner = here()
    assert main([*SMALL, *words.split()]) == 2
    error = capsys.readouterr().err
    assert REFUSED[words] in error
    assert error.count("\n") == 1
    assert runner.folders == []
    assert list(Path().iterdir()) == []


def test_a_controller_that_is_not_there_is_refused(here, capsys):
    here()
    assert main(["tune", "vprn", "--scenario", "circle_lwr4plus", "--budget", "9"]) == 2
    assert "Did you mean 'vprnn'?" in capsys.readouterr().err


def test_a_folder_of_something_else_or_of_a_tuning_is_not_written_over(here, capsys):
    here()
    Path("mine").mkdir()
    Path("mine/notes.txt").write_text("mine", encoding="utf-8")
    assert main([*SMALL, "--budget", "4", "--out", "mine", "--resume"]) == 2
    assert "mine holds 'notes.txt', which is not of this tuning" in capsys.readouterr().err
    assert main([*SMALL, "--budget", "4", "--out", "t"]) == 0
    assert main([*SMALL, "--budget", "4", "--out", "t"]) == 2
    assert "t holds a tuning; give --resume to go on with it" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["[1]\n", "{}\n", "no\n", '{"scenario": 1}\n'])
def test_a_damaged_file_of_runs_is_refused(here, capsys, text):
    here()
    Path("t").mkdir()
    Path("t/evaluations.jsonl").write_text(text, encoding="utf-8")
    assert main([*SMALL, "--budget", "4", "--out", "t", "--resume"]) == 2
    assert "t/evaluations.jsonl: cannot be read: " in capsys.readouterr().err
