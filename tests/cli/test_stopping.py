"""Ctrl-C and SIGTERM in a run or a batch: only whole results, no draft, and `--resume` goes on."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from batches import short_run

from surgsim.compare.table import read_table
from surgsim.runs.stop import Stopped, stopping_in_order

LONG_RUN = ["run", "circle_lwr4plus", "--out", "out/run", "--set", "task.duration_s=20"]
FILES = {"scenario.yaml", "metrics.json", "recording.rrd"}


@pytest.fixture
def lenient(surgsim):
    """Starts `surgsim` in a terminal. A warning is no error: a signal may meet a `git` that is starting."""

    def start(*words, **options):
        return surgsim(*words, strict=False, env={"MUJOCO_GL": "disable"}, **options)

    return start


def draft_in(folder):
    return lambda: any(path.name.endswith(".part") for path in folder.glob(".run.*"))


COLD = ("Ctrl-C",)
"""How processes are ended that a person's shell has started; the others are forks of a warm one."""
ENDED = {
    "Ctrl-C": (130, "surgsim: interrupted; nothing half done is left"),
    "SIGINT": (130, "surgsim: interrupted; nothing half done is left"),
    "SIGTERM": (143, "surgsim: ended by SIGTERM; nothing half done is left"),
    "SIGHUP": (129, "surgsim: ended by SIGHUP; nothing half done is left"),
}


@pytest.mark.parametrize("how", ENDED)
def test_a_run_that_is_ended_while_it_is_written_leaves_nothing(lenient, tmp_path, how):
    typed = lenient(*LONG_RUN, cold=how in COLD).wait(until=draft_in(tmp_path / "out"))
    if how == "Ctrl-C":
        typed.press(b"\x03")
    else:
        os.kill(typed.process.pid, getattr(signal, how))
        os.kill(typed.process.pid, getattr(signal, how))  # as `timeout` does
    typed.wait()
    status, text = ENDED[how]
    assert (typed.status, typed.lines[-1]) == (status, text)
    assert "Traceback" not in typed.text
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("how", ["Ctrl-C", "SIGTERM"])
def test_a_run_that_is_ended_on_its_way_leaves_nothing(lenient, tmp_path, how):
    typed = lenient(*LONG_RUN, cold=how in COLD)
    typed.wait(until=lambda: "x real time" in typed.text)
    if how == "Ctrl-C":
        typed.press(b"\x03")
    else:
        os.kill(typed.process.pid, signal.SIGTERM)
    typed.wait()
    assert (typed.status, typed.lines[-1]) == ENDED[how]
    assert list(tmp_path.rglob("*")) == []


def test_what_a_killed_run_left_goes_with_the_next(lenient, tmp_path):
    typed = lenient(*LONG_RUN).wait(until=draft_in(tmp_path / "out"))
    os.killpg(typed.process.pid, signal.SIGKILL)
    typed.process.wait()
    assert [path.suffix for path in (tmp_path / "out").iterdir()] == [".part"]
    done = lenient(
        "run", "circle_lwr4plus", "--out", "out/run", *(f"--set={setting}" for setting in short_run())
    ).wait()
    assert done.status == 0, done.text
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["run"]
    assert {path.name for path in (tmp_path / "out" / "run").iterdir()} == FILES


SUITE = """\
name: tiny
scenarios: [circle_lwr4plus]
controllers: [pinv]
seeds: "0:12"
record: true
settings: [theatre=false, task.duration_s=0.5, task.ramp_s=0.1, task.hold_start_s=0, task.hold_end_s=0]
"""


@pytest.mark.parametrize("how", ["Ctrl-C", "SIGTERM", "SIGTERM to all"])
def test_a_batch_that_is_ended_is_gone_on_with(lenient, tmp_path, how):
    (tmp_path / "tiny.yaml").write_text(SUITE)
    command = ["compare", "tiny.yaml", "--out", "out", "--jobs", "2"]
    typed = lenient(*command, cold=how in COLD)
    typed.wait(until=lambda: any(whole_runs(tmp_path)))
    children = (
        Path(f"/proc/{typed.process.pid}/task/{typed.process.pid}/children")
        .read_text(encoding="utf-8")
        .split()
    )
    if how == "Ctrl-C":
        typed.press(b"\x03")
    elif how == "SIGTERM":
        os.kill(typed.process.pid, signal.SIGTERM)
    else:  # as a cluster at the end of the time limit
        os.killpg(typed.process.pid, signal.SIGTERM)
    typed.wait()
    told = "interrupted" if how == "Ctrl-C" else "ended by SIGTERM"
    assert typed.lines[-1] == f"surgsim: {told}; --resume --out out runs what is missing"
    assert typed.status == (130 if how == "Ctrl-C" else 143)
    assert "Traceback" not in typed.text
    end = time.monotonic() + 30.0
    while any(alive(pid) for pid in children):
        assert time.monotonic() < end, "processes are left"
        time.sleep(0.02)
    whole = whole_runs(tmp_path)
    assert 1 <= len(whole) < 12
    assert all({path.name for path in folder.iterdir()} == FILES for folder in whole)
    assert [path for path in tmp_path.rglob("*") if path.name.startswith(".")] == []
    again = lenient(*command, "--resume").wait()
    assert again.status == 0, again.text
    assert read_table(tmp_path / "out")["outcome"] == ("completed",) * 12
    assert whole.items() <= whole_runs(tmp_path).items(), "a whole run was done again"


TUNE = [
    *("tune", "joint_impedance", "--scenario", "circle_lwr4plus", "--out", "out", "--jobs", "2"),
    *(f"--set={setting}" for setting in short_run(0.3)),
    *("--budget", "60"),
]


@pytest.mark.parametrize("how", ["Ctrl-C", "SIGTERM"])
def test_a_tuning_that_is_ended_is_gone_on_with(lenient, tmp_path, how):
    runs, found = tmp_path / "out" / "evaluations.jsonl", tmp_path / "out" / "joint_impedance_tuned.yaml"

    def lines():
        return runs.read_text(encoding="utf-8").splitlines() if runs.exists() else []

    typed = lenient(*TUNE, cold=how in COLD).wait(until=lambda: len(lines()) > 3)
    if how == "Ctrl-C":
        typed.press(b"\x03")
    else:
        os.kill(typed.process.pid, signal.SIGTERM)
    typed.wait()
    told = "interrupted" if how == "Ctrl-C" else "ended by SIGTERM"
    said = (
        f"surgsim: {told}; the best so far is in out/joint_impedance_tuned.yaml; --resume --out out goes on"
    )
    assert said in " ".join(typed.lines)
    assert typed.status == (130 if how == "Ctrl-C" else 143)
    assert "Traceback" not in typed.text
    assert "# interrupted" in found.read_text(encoding="utf-8")
    assert [path for path in tmp_path.rglob("*") if path.name.startswith(".")] == []
    kept = lines()
    again = lenient(*TUNE, "--resume").wait()
    assert again.status == 0, again.text
    assert lines()[: len(kept)] == kept
    assert "# interrupted" not in found.read_text(encoding="utf-8")


def whole_runs(folder):
    """Folders of the runs that are whole, with the time at which each was written."""
    found = folder.glob("out/runs/*/*/[!.]*/metrics.json")
    return {path.parent: path.stat().st_mtime_ns for path in found}


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_signal_that_is_ignored_stays_so():
    """`nohup surgsim compare ... &` survives the end of the terminal."""
    code = (
        "import os, signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        "from surgsim.runs.stop import stopping_in_order\n"
        "with stopping_in_order(): os.kill(os.getpid(), signal.SIGHUP); print('here')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "here\n"), done.stderr


def test_a_second_signal_does_not_disturb_the_tidying_and_handlers_are_put_back():
    before = signal.getsignal(signal.SIGTERM)
    tidied = []

    def command():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(1.0)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.01)
            tidied.append(True)

    with pytest.raises(Stopped, match="SIGTERM"), stopping_in_order():
        command()
    assert tidied
    assert signal.getsignal(signal.SIGTERM) is before


FINALISED = """
import os, signal, time
from surgsim.runs.stop import Stopped, obey_parent, stopping_in_order

class Finalised:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
        for _ in range(100):  # the handler raises here, and Python drops what it raises
            time.sleep(0.001)

def last_long():
    Finalised()
    time.sleep(20.0)
"""
COMMAND = """
try:
    with stopping_in_order():
        last_long()
except Stopped as stopped:
    raise SystemExit(stopped.exit_status)
"""
WORKER = """
obey_parent()
last_long()
"""


@pytest.mark.parametrize("process", [COMMAND, WORKER], ids=["command", "worker"])
def test_a_signal_that_comes_while_an_object_is_finalised_is_not_lost(process):
    began = time.monotonic()
    words = [sys.executable, "-c", FINALISED + process]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (128 + signal.SIGTERM, "")
    assert time.monotonic() - began < 15.0


def test_a_worker_that_leaves_is_not_disturbed_however_late_the_signal_comes():
    """Python complains of a signal that came just before it was to be ignored; here it does nothing."""
    code = (
        "import os, signal\n"
        "from surgsim.runs import stop\n"
        "stop._leave_at_a_signal()\n"
        "stop.leave_in_peace()\n"
        "assert callable(signal.getsignal(signal.SIGTERM))\n"
        "for _ in range(100):\n    os.kill(os.getpid(), signal.SIGTERM)\n"
        "print('left')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "left\n", "")
