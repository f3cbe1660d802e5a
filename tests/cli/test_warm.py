"""A fork of a warm process does what a process that has to start does."""

import os
import signal
import subprocess
import sys

import pytest

ASKED = {
    "listing": (("list", "robots"), 0),
    "refusal": (("check", "nothing.yaml"), 2),
    "usage": (("fly",), 2),
    "checked": (("check", "circle_lwr4plus", "--quiet"), 0),
}


@pytest.mark.parametrize("name", ASKED)
def test_it_says_the_same_and_ends_alike(warm, tmp_path, name):
    words, status = ASKED[name]
    command = [sys.executable, "-W", "error", "-m", "surgsim", *words]
    cold = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=100)
    done = warm.run(words, tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (status, cold.stdout, cold.stderr)


def test_it_has_its_folder_its_variables_and_its_own_process(warm, tmp_path):
    (tmp_path / "mine.yaml").write_text("robots: 3\n")
    done = warm.run(("check", "mine.yaml"), tmp_path)
    assert (done.returncode, "mine.yaml" in done.stderr) == (2, True)
    assert "\x1b[" in warm.run(("list", "robots"), tmp_path, FORCE_COLOR="1").stdout
    assert "\x1b[" not in warm.run(("list", "robots"), tmp_path, NO_COLOR="1").stdout


def test_a_command_that_takes_too_long_is_ended(warm, tmp_path):
    words = ("run", "circle_lwr4plus", "--set", "task.duration_s=200", "--out", "out")
    with pytest.raises(subprocess.TimeoutExpired):
        warm.run(words, tmp_path, 0.5)


def test_its_end_by_a_signal_is_told_as_one(warm, tmp_path):
    with open(os.devnull, "r+b") as nothing:
        streams = [nothing.fileno()] * 3
        command = warm.start(
            ("run", "circle_lwr4plus", "--set", "task.duration_s=200"), streams, tmp_path, os.environ
        )
        assert command.poll() is None
        os.kill(command.pid, signal.SIGKILL)
        assert command.wait(timeout=60) == -signal.SIGKILL
