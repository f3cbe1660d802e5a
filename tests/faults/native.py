"""Makes the n-th call below a folder fail, for every n, in a child each; started with `shim.so` preloaded.

The parent has everything imported and compiled but rerun, whose threads would not survive a fork. Prints one
line of JSON: how many points were tried, and what was wrong.
"""

import ctypes
import json
import os
import signal
import sys
import time
from pathlib import Path

from batches import Here, short_run

from surgsim.cli.main import main
from surgsim.compare import engine, job
from surgsim.compare.engine import Batch, compare
from surgsim.compare.suite import SuiteConfig, check_runs, expand
from surgsim.errors import SurgsimError
from surgsim.recording.contents import check_contents
from surgsim.recording.sealed import read_sealed
from surgsim.runs.folder import execute

TIMEOUT_S = 120.0
MOST = 2000
SHIM = ctypes.CDLL(None)
SHIM.shim_calls.restype = ctypes.c_long
SHORT = short_run()
SUITE = SuiteConfig(
    name="small", scenarios=("circle_lwr4plus",), controllers=("pinv",), seeds="0:2", settings=SHORT
)


def arm(root: Path, n: int, stays_full: bool) -> None:
    """Let the n-th call below `root` fail from now on; 0 for none."""
    SHIM.shim_arm(os.fsencode(root), ctypes.c_long(n), ctypes.c_int(stays_full))


def in_child(work) -> tuple[int | None, bool]:
    """Exit status of `work` in a child, None if it hung, and whether the call that was to fail came."""
    sys.stdout.flush()
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        status = 99
        try:
            status, reached = work()
            os.write(writing, b"1" if reached else b"0")
        finally:
            os._exit(status)
    os.close(writing)
    until = time.monotonic() + TIMEOUT_S
    while (ended := os.waitpid(child, os.WNOHANG))[0] == 0 and time.monotonic() < until:
        time.sleep(0.005)
    if ended[0] == 0:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    said = os.read(reading, 1)
    os.close(reading)
    return (None if ended[0] == 0 else os.waitstatus_to_exitcode(ended[1])), said == b"1"


def hidden(root: Path) -> list[str]:
    return [str(path.relative_to(root)) for path in root.rglob(".*")]


def run_point(root: Path, n: int, stays_full: bool, there: bool) -> tuple[list[str], bool]:
    """A recorded run by the command line; `there`: over an earlier one."""
    folder = root / "deep" / "run"
    command = ["run", "circle_lwr4plus", *(word for each in SHORT for word in ("--set", each))]
    seeds = (1, 2) if there else (None, 2)
    if there:
        assert main([*command, "--seed", "1", "--no-record", "--json", "--out", str(folder)]) == 0

    def work() -> tuple[int, bool]:
        arm(root, n, stays_full)
        status = main([*command, "--seed", "2", "--json", "--out", str(folder)])
        reached = SHIM.shim_calls() >= n
        return status, reached

    status, reached = in_child(work)
    wrong = [] if status in (0, 2) else [f"exit status {status}"]
    found = None
    if folder.exists():
        try:
            check_contents(folder)
            found = read_sealed(folder / "metrics.json")["seed"]
        except (SurgsimError, OSError, ValueError) as error:
            wrong.append(f"damaged: {error}")
    if found not in seeds or (status == 0 and found != 2):
        wrong.append(f"exit status {status} with the run of seed {found}")
    return [*wrong, *(f"left: {name}" for name in hidden(root))], reached


def batch_point(root: Path, n: int, stays_full: bool, table) -> tuple[list[str], bool]:
    """A batch, and another that resumes it."""
    out = root / "out"

    def work() -> tuple[int, bool]:
        arm(root, n, stays_full)
        try:
            compare(Batch(suite=SUITE, folder=Path(), out=out), runner=Here())
            status = 0
        except (SurgsimError, job.DiskError):
            status = 2
        return status, SHIM.shim_calls() >= n

    status, reached = in_child(work)
    wrong = [] if status in (0, 2) else [f"exit status {status}"]
    wrong += [f"left: {name}" for name in hidden(root)]
    whole = {str(path.parent) for path in out.glob("runs/*/*/[!.]*/metrics.json")}
    for folder in whole:
        check_contents(Path(folder))
    runner = Here()
    resumed = compare(Batch(suite=SUITE, folder=Path(), out=out, resume=True), runner=runner)
    again = runner.folders
    kept = ("run_id", "outcome", "tip_error_rms_mm", "rcm_error_rms_mm")
    if resumed is None or any(resumed[name] != table[name] for name in kept):
        wrong.append("--resume gives another table")
    if whole & {*again} or len(whole) + len(again) != len(table):
        wrong.append(f"--resume did {len(again)} runs, {len(whole)} were whole")
    return wrong, reached


def search(root: Path, kind: str) -> None:
    """Try every point, once failing alone and once as the first of a disk that stays full."""
    made: dict[str, object] = {}
    checked = check_runs(expand(SUITE, Path()))
    engine.check_runs = lambda specs: checked  # type: ignore[assignment]
    for scenario in checked:
        made[scenario.sha256()] = execute(scenario)
    job.execute = lambda scenario: made[scenario.sha256()]  # type: ignore[assignment]
    table = compare(Batch(suite=SUITE, folder=Path(), out=root / "reference"), runner=Here())
    points, wrong = 0, {}
    for stays_full in (False, True):
        for n in range(1, MOST):
            place = root / f"{kind}-{stays_full}-{n}"
            place.mkdir()
            if kind == "batch":
                found, reached = batch_point(place, n, stays_full, table)
            else:
                found, reached = run_point(place, n, stays_full, kind == "replaced")
            if found:
                wrong[place.name] = found
            if not reached and not found:
                break
            points += 1
    print("RESULT " + json.dumps({"points": points, "wrong": wrong}), flush=True)


if __name__ == "__main__":
    search(Path(sys.argv[1]).resolve(), sys.argv[2])
