"""The same refusals by the real program: one line, exit 2, no traceback, in bounded time."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from warm import Warm

GOOD = Path(__file__).with_name("good.yaml")
HERE = Path(__file__).parent / "scenarios"
LONG = "x" * 5000
COMMANDS = {
    "check alias bomb": ["check", HERE / "billion_laughs.yaml"],
    "check deep": ["check", HERE / "deep_nesting.yaml"],
    "check unreachable": ["check", HERE / "circle_too_wide.yaml"],
    "check overflow": ["check", HERE / "radius_overflows_later.yaml"],
    "check pipe": ["check", "pipe.yaml"],
    "check loop": ["check", "loop.yaml"],
    "check zeros": ["check", "/dev/zero"],
    "check png": ["check", "picture.yaml"],
    "check new line": ["check", "a\nb"],
    "run too long": ["run", HERE / "too_long.yaml"],
    "run long folder": ["run", GOOD, "--out", LONG],
    "compare pipe": ["compare", "pipe.yaml"],
    "compare shard": ["compare", GOOD, "--shard", "²/3"],
    "compare resume": ["compare", GOOD, "--resume", "--out", "."],
    "report folder": ["report", "."],
    "inspect zeros": ["inspect", "/dev/zero"],
    "inspect empty": ["inspect", "empty.rrd", "--json"],
    "inspect png": ["inspect", "picture.yaml"],
    "inspect garbage": ["inspect", "garbage.rrd"],
    "reproduce": ["reproduce", "vprn"],
    "tune": ["tune", "vprn", "--scenario", GOOD, "--budget", "9"],
    "submit folder": ["submit", "."],
    "verify zeros": ["verify", "/dev/zero"],
    "verify png": ["verify", "picture.yaml"],
    "verify empty": ["verify", "empty.rrd", "--json"],
    "verify pipe": ["verify", "."],
}
COLD = (
    "check pipe",
    "run too long",
    "compare resume",
    "report folder",
    "inspect garbage",
    "reproduce",
    "tune",
    "submit folder",
    "verify zeros",
)
"""One of each command, which a process has to start for first; the others are forks of a warm one."""


@pytest.mark.parametrize("name", COMMANDS)
def test_refused(name: str, tmp_path: Path, warm: Warm) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    (tmp_path / "loop.yaml").symlink_to("loop.yaml")
    (tmp_path / "picture.yaml").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(1000))
    (tmp_path / "empty.rrd").write_bytes(b"")
    (tmp_path / "garbage.rrd").write_bytes(b"RRF2\x00\x29\x00\x00\x00\x02\x00\x00" + bytes(range(256)) * 40)
    before = sorted(path.name for path in tmp_path.iterdir())
    words = [str(word) for word in COMMANDS[name]]
    if name in COLD:
        command = [sys.executable, "-W", "error", "-m", "surgsim", *words]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=20)
    else:
        done = warm.run(words, tmp_path, 20.0)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert re.fullmatch(r"surgsim: [^\n]{10,1000}\n", done.stderr), done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_there_are_enough() -> None:
    assert len(COMMANDS) >= 20
