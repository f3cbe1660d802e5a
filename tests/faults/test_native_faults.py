"""Every call to the C library that changes the disk fails in turn, whoever makes it: rerun, pyarrow too."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        sys.platform != "linux" or shutil.which("cc") is None, reason="needs Linux and a C compiler"
    ),
]


@pytest.fixture(scope="module")
def shim(tmp_path_factory) -> Path:
    made = tmp_path_factory.mktemp("shim") / "shim.so"
    command = [
        "cc",
        "-shared",
        "-fPIC",
        "-O1",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-o",
        made,
        HERE / "shim.c",
        "-ldl",
    ]
    subprocess.run(command, check=True)
    return made


@pytest.mark.parametrize(("kind", "least"), [("new", 55), ("replaced", 60), ("batch", 120)])
def test_nothing_hangs_is_damaged_or_left(shim, tmp_path, kind, least):
    command = [sys.executable, HERE / "native.py", tmp_path, kind]
    paths = [str(HERE.parent / "plugins"), *filter(None, [os.environ.get("PYTHONPATH")])]
    done = subprocess.run(
        command,
        env={**os.environ, "LD_PRELOAD": str(shim), "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
        timeout=3600,
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout.rpartition("RESULT ")[2])
    print(f"{kind}: {result['points']} points")
    assert result["wrong"] == {}
    assert result["points"] >= least
