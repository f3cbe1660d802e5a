"""A small disk that a recorded run fills: the command ends at once, says why, and leaves nothing."""

import subprocess
import sys

import pytest
from batches import short_run

pytestmark = pytest.mark.needs("mount")

COMMAND = ("-m", "surgsim", "run", "circle_lwr4plus", *(f"--set={one}" for one in short_run(0.5)))
ON_A_DISK = """
mount -t tmpfs -o size="$1" tmpfs "$2" && shift && disk="$1" && shift && "$@" --out "$disk/run"
echo "exit $? holds $(ls -A "$disk")"
"""


@pytest.fixture(scope="module")
def size(tmp_path_factory):
    """What a recorded run takes [bytes]."""
    out = tmp_path_factory.mktemp("whole") / "run"
    done = subprocess.run(
        [sys.executable, *COMMAND, "--out", out], capture_output=True, text=True, timeout=240
    )
    assert done.returncode in (0, 1), done.stderr
    return sum(path.stat().st_size for path in out.iterdir())


def run_on_a_disk(folder, size):
    """The command on a disk of `size` bytes; what it said, and what it left there."""
    disk = folder / "disk"
    disk.mkdir()
    words = ["sh", "-c", ON_A_DISK, "sh", str(size), disk, sys.executable, *COMMAND]
    done = subprocess.run(["unshare", "-rm", *words], capture_output=True, text=True, timeout=60)
    return done.stderr, done.stdout.splitlines()[-1]


@pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
def test_a_recording_that_fills_the_disk_ends_and_leaves_nothing(size, tmp_path, share):
    said, left = run_on_a_disk(tmp_path, int(share * size))
    file = f"{tmp_path}/disk/run/recording.rrd"
    assert said.splitlines()[-1] == f"surgsim: {file}: cannot be written: No space left on device"
    assert left == "exit 2 holds "


def test_a_disk_with_room_for_the_run_holds_it(size, tmp_path):
    said, left = run_on_a_disk(tmp_path, size + 65_536)  # files take whole pages
    assert left in ("exit 0 holds run", "exit 1 holds run"), said
