"""Modules that run as programs of their own."""

import subprocess

import pytest

from surgsim.resources import run_module

MODULE = """
import os, sys
print(sys.argv[1:], sys.stdin.read(), os.environ.get("SAID"))
sys.exit(3)
"""


@pytest.fixture
def module(tmp_path, monkeypatch):
    """A module that this process can import, beside a working folder that holds one of a standard name."""
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "some_program.py").write_text(MODULE)
    (tmp_path / "work").mkdir()
    (tmp_path / "work" / "json.py").write_text("raise RuntimeError('not the standard one')")
    monkeypatch.syspath_prepend(tmp_path / "here")
    monkeypatch.chdir(tmp_path / "work")


def test_it_is_given_words_input_and_surroundings(module):
    done = run_module("some_program", "a", "b c", timeout_s=60.0, given=b"input", environment={"SAID": "x"})
    assert (done.returncode, done.stdout) == (3, b"['a', 'b c'] input x\n")


def test_nothing_is_imported_from_the_working_folder(module):
    done = run_module("json.tool", timeout_s=60.0, given=b"[1]")
    assert (done.returncode, done.stdout.split()) == (0, [b"[", b"1", b"]"]), done.stderr


def test_one_that_takes_too_long_is_ended(module):
    with pytest.raises(subprocess.TimeoutExpired):
        run_module("http.server", "0", timeout_s=1.0)
