"""What is left out is counted and named; CI's flag makes a failure of it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PLUGINS = Path(__file__).with_name("plugins")
CONFTEST = """
import left_out
left_out.PARTS.update(
    wand=left_out.Part("magic", lambda: False, "no wand"),
    stone=left_out.Part("stone", lambda: True, "no stone"),
)
"""
MODULE = """
import pytest
needs_wand = pytest.mark.needs("wand")

@needs_wand
def test_one(): assert False

@needs_wand
def test_two(): assert False

@pytest.mark.needs("stone")
def test_three(): pass

@pytest.mark.slow
def test_four(): assert False

@pytest.mark.xfail(strict=True)
def test_five(): assert False
"""
HIDDEN = "import pytest\npytest.importorskip('surgsim_nowhere')\n"
OTHER = "import pytest\ndef test_six(): pytest.skip('moon')\n"


@pytest.fixture
def run(tmp_path):
    """Runs pytest on the modules given and returns exit status and output."""

    def call(*words, **modules):
        (tmp_path / "conftest.py").write_text(CONFTEST)
        (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = slow: s\naddopts = --strict-markers\n")
        for name, text in modules.items():
            (tmp_path / f"test_{name}.py").write_text(text)
        command = [sys.executable, "-m", "pytest", "-q", "-p", "left_out", "-m", "not slow", *words]
        environment = {**os.environ, "PYTHONPATH": str(PLUGINS)}
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120
        )
        return done.returncode, done.stdout + done.stderr

    return call


WORKERS = pytest.mark.parametrize("workers", [(), ("-n", "2")], ids=["alone", "xdist"])


@WORKERS
def test_one_line_says_what_was_left_out_and_why(run, workers):
    status, out = run(*workers, module=MODULE, hidden=HIDDEN, other=OTHER)
    assert status == 0, out
    (line,) = [line for line in out.splitlines() if line.startswith("left out: ")]
    missing = "could not import 'surgsim_nowhere': No module named 'surgsim_nowhere'"
    assert line == (
        f"left out: 2 magic tests (no wand), 1 test ({missing}), 1 test (moon), 1 slow test (make test-all)"
    )


@WORKERS
@pytest.mark.parametrize("module", ["module", "hidden", "other"])
def test_no_skips_makes_a_failure_of_every_skip(run, workers, module):
    texts = {"module": MODULE, "hidden": HIDDEN, "other": OTHER}
    status, out = run("--no-skips", *workers, **{module: texts[module], "fine": "def test_fine(): pass\n"})
    assert status in (1, 2), out
    assert "is left out, and --no-skips allows none (" in out


def test_nothing_is_said_where_nothing_is_left_out(run):
    status, out = run("--no-skips", fine="def test_fine(): pass\n")
    assert status == 0
    assert "left out" not in out


def test_an_unknown_part_is_an_error(run):
    status, out = run(bad="import pytest\n@pytest.mark.needs('sun')\ndef test(): pass\n")
    assert status != 0
    known = "chromium, ray, video, sphinx, opengl, display, compiler, namespace, mount"
    assert f"needs 'sun', which is none of {known}" in out
