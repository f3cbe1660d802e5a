"""Every call that reaches the disk fails in turn: nothing is damaged or left, and `--resume` is right."""

from pathlib import Path

import pytest
from batches import Here, short_run

from surgsim.compare import engine, job
from surgsim.compare.engine import Batch, compare
from surgsim.compare.job import DiskError
from surgsim.compare.suite import SuiteConfig, check_runs
from surgsim.compare.table import MACHINE_COLUMNS, read_table
from surgsim.errors import SurgsimError
from surgsim.recording.contents import check_contents
from surgsim.recording.sealed import read_sealed
from surgsim.runs.folder import execute, write_run

MOST = 1000
BOTH = pytest.mark.parametrize("stays_full", [False, True], ids=["one call fails", "the disk stays full"])
SUITE = SuiteConfig(
    name="small",
    scenarios=("circle_lwr4plus",),
    controllers=("pinv",),
    seeds="0:2",
    settings=short_run(),
)


@pytest.fixture(scope="module")
def finished(scenario):
    """Two runs of one folder: an earlier one and its successor."""
    scenarios = [scenario("task.duration_s=0.2", seed=seed) for seed in (1, 2)]
    return [(each, execute(each)) for each in scenarios]


def seed_of(folder: Path) -> int | None:
    """Seed of the whole run in `folder`; None if there is no folder."""
    if not folder.exists():
        return None
    check_contents(folder)
    return int(read_sealed(folder / "metrics.json")["seed"])


def fails(disk, write) -> bool:
    """Whether `write` says that the disk refuses; any other error is passed on. The disk is whole again."""
    try:
        write()
    except (SurgsimError, DiskError):
        return True
    finally:
        disk.heal()
    return False


def hidden(root: Path) -> list[str]:
    return [str(path.relative_to(root)) for path in root.rglob(".*")]


@BOTH
@pytest.mark.parametrize("there", [False, True], ids=["new", "replaced"])
def test_a_run_is_there_whole_or_not_at_all(finished, faulty_disk, tmp_path, there, stays_full):
    """The earlier run, the new run, or none where there was none; until a call is not reached any more."""
    (old, before), (new, after) = finished
    for n in range(1, MOST):
        root = tmp_path / str(n)
        folder = root / "deep" / "run"
        if there:
            write_run(old, before, folder, record=False)
        disk = faulty_disk(root, n, stays_full)
        failed = fails(disk, lambda: write_run(new, after, folder, record=not stays_full))  # noqa: B023
        what = f"call {n}, {disk.calls[-1]}"
        found = seed_of(folder)
        assert found in ({1, 2} if there else {None, 2}), what
        assert failed or found == 2, f"{what}: told as written"
        assert hidden(root) == [], what
        if not disk.was_reached:
            break
    print(f"{n - 1} points: {disk.calls}")
    assert not failed
    assert {"create", "write", "fsync", "close", "mkdir", "rename"} <= {*disk.calls}


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """Table of the batch on a disk that never fails, and results by scenario, so that none is run again."""
    made = {}

    def once(scenario):
        return made.setdefault(scenario.sha256(), execute(scenario))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(job, "execute", lambda scenario: once(scenario))
        table = compare(batch(tmp_path_factory.mktemp("reference")), runner=Here())
    return table, made


def batch(out: Path, resume: bool = False) -> Batch:
    return Batch(suite=SUITE, folder=Path(), out=out, resume=resume)


def same(a, b) -> bool:
    kept = [repr(table.without(MACHINE_COLUMNS)) for table in (a, b)]
    return kept[0] == kept[1]


@pytest.mark.parametrize("stays_full", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_batch_keeps_what_is_whole_and_resumes_with_the_rest(
    reference, faulty_disk, tmp_path, monkeypatch, stays_full
):
    table, made = reference
    monkeypatch.setattr(job, "execute", lambda scenario: made[scenario.sha256()])
    checked: list = []
    monkeypatch.setattr(
        engine, "check_runs", lambda specs: checked or checked.extend(check_runs(specs)) or checked
    )
    for n in range(1, MOST):
        out = tmp_path / str(n) / "out"
        disk = faulty_disk(tmp_path / str(n), n, stays_full)
        failed = fails(disk, lambda: compare(batch(out), runner=Here()))  # noqa: B023
        what = f"call {n}, {disk.calls[-1]}"
        whole = [path.parent for path in out.glob("runs/*/*/[!.]*/metrics.json")]
        for folder in whole:
            check_contents(folder)
        assert hidden(tmp_path / str(n)) == [], what
        assert failed or same(read_table(out), table), f"{what}: told as finished"
        again = Here()
        assert same(compare(batch(out, resume=True), runner=again), table), what
        assert not {*again.folders} & {str(folder) for folder in whole}, f"{what}: run again"
        assert len(again.folders) + len(whole) == len(table), what
        assert same(read_table(out), table), what
        assert hidden(out) == [], what
        if not disk.was_reached:
            break
    print(f"{n - 1} points: {disk.calls}")
    assert not failed
