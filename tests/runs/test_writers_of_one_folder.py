"""Many writers of one folder, and a reader: the folder is there at every moment, and nothing else is left."""

import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

import pytest

from surgsim.errors import SurgsimError
from surgsim.runs import exchange
from surgsim.runs.drafts import clear_drafts
from surgsim.runs.folder import whole_folder

WRITERS, TIMES = 3, 60
SPAWN = multiprocessing.get_context("spawn")


def _write(place: Path, can_swap: bool, ended) -> None:
    os.fsync = lambda handle: None  # the order of the steps is tried here, not the disk
    if not can_swap:
        exchange.swap = lambda a, b: False
    for _ in range(TIMES):
        with whole_folder(place) as draft:
            (draft / "metrics.json").write_text("a" * 5000)
    ended.put(True)


def _meet(place: Path, can_swap: bool) -> tuple[int, int, int]:
    """Let the writers write; looks at the folder, looks that missed it, and writers that ended well."""
    ended = SPAWN.Queue()
    writers = [SPAWN.Process(target=_write, args=(place, can_swap, ended)) for _ in range(WRITERS)]
    for writer in writers:
        writer.start()
    looks = missed = 0
    while any(writer.is_alive() for writer in writers):
        try:
            whole = (place / "metrics.json").stat().st_size == 5000
            looks, missed = looks + 1, missed + (not whole)
        except FileNotFoundError:
            missed += looks > 0
    for writer in writers:
        writer.join()
    return looks, missed, sum(ended.get(timeout=5) for writer in writers if writer.exitcode == 0)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux swaps two folders in one step")
def test_writers_never_collide_and_a_reader_never_misses_the_folder(tmp_path):
    looks, missed, ended = _meet(tmp_path / "run", can_swap=True)
    assert (missed, ended) == (0, WRITERS)
    assert looks > 100
    assert os.listdir(tmp_path) == ["run"]


def test_where_folders_cannot_be_swapped_writers_take_turns(tmp_path):
    _, _, ended = _meet(tmp_path / "run", can_swap=False)
    assert ended == WRITERS
    assert os.listdir(tmp_path) == ["run"]
    assert (tmp_path / "run" / "metrics.json").stat().st_size == 5000


def _make(folder: Path, text: str) -> Path:
    folder.mkdir()
    (folder / "metrics.json").write_text(text)
    return folder


def test_swap_says_whether_it_can(tmp_path, monkeypatch):
    a, b = _make(tmp_path / "a", "of a"), _make(tmp_path / "b", "of b")
    assert exchange.swap(a, b) == (sys.platform == "linux")
    monkeypatch.setattr(exchange, "_renameat2", lambda: None)
    before = (b / "metrics.json").read_text()
    assert not exchange.swap(a, b)
    assert (b / "metrics.json").read_text() == before


def test_a_folder_that_a_killed_writer_set_aside_comes_back(tmp_path):
    _make(tmp_path / ".run.0123.old", "earlier")
    with pytest.raises(ZeroDivisionError), whole_folder(tmp_path / "run"):
        1 / 0  # noqa: B018
    assert os.listdir(tmp_path) == ["run"]
    assert (tmp_path / "run" / "metrics.json").read_text() == "earlier"


def test_what_was_set_aside_goes_once_its_successor_is_there(tmp_path):
    _make(tmp_path / ".run.0123.old", "earlier")
    _make(tmp_path / "run", "later")
    exchange.restore_all(tmp_path)
    assert os.listdir(tmp_path) == ["run"]
    assert (tmp_path / "run" / "metrics.json").read_text() == "later"


def test_a_failed_rename_without_swap_keeps_the_earlier_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(exchange, "swap", lambda a, b: False)
    _make(tmp_path / "run", "earlier")
    real, calls = os.rename, []

    def rename(source, target):
        calls.append(Path(source).name)
        if len(calls) == 4:  # the draft, after the earlier folder was set aside
            raise OSError(28, "No space left on device")
        real(source, target)

    monkeypatch.setattr(os, "rename", rename)
    with (
        pytest.raises(SurgsimError, match="No space left on device"),
        whole_folder(tmp_path / "run") as draft,
    ):
        (draft / "metrics.json").write_text("new")
    assert calls[2] == "run"
    assert os.listdir(tmp_path) == ["run"]
    assert (tmp_path / "run" / "metrics.json").read_text() == "earlier"


def test_a_draft_of_a_dead_process_is_removed_and_that_of_a_living_one_is_kept(tmp_path):
    script = (
        "import os, sys, pathlib; from surgsim.runs.folder import whole_folder\n"
        "with whole_folder(pathlib.Path(sys.argv[1])) as draft:\n"
        "    print(draft.name, flush=True); sys.stdin.read(); os._exit(9)"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "run")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        draft = process.stdout.readline().strip()
        clear_drafts(tmp_path)
        assert os.listdir(tmp_path) == [draft]
        process.stdin.close()
        process.wait(timeout=60)
    assert os.listdir(tmp_path) == [draft]
    clear_drafts(tmp_path, "other")
    assert os.listdir(tmp_path) == [draft]
    clear_drafts(tmp_path, "run")
    assert os.listdir(tmp_path) == []


def test_a_link_stays_and_what_it_points_to_is_replaced(tmp_path):
    _make(tmp_path / "place", "earlier")
    (tmp_path / "link").symlink_to(tmp_path / "place")
    with whole_folder(tmp_path / "link") as draft:
        (draft / "metrics.json").write_text("new")
    assert sorted(os.listdir(tmp_path)) == ["link", "place"]
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "place" / "metrics.json").read_text() == "new"
