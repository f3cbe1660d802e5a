"""Drafts: what a dead process left is removed, what a living one writes is not."""

import os
import subprocess
import sys

import pytest

from surgsim.runs import drafts
from surgsim.runs.drafts import clear_drafts, draft_of
from surgsim.runs.exchange import restore

HOLD = """
import sys
from pathlib import Path
from surgsim.runs.drafts import draft_of
with draft_of(Path(sys.argv[1])) as draft:
    (draft / "half").write_text("")
    print(draft.name, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """A process that holds a draft of the folder `run`, and the draft."""
    command = [sys.executable, "-c", HOLD, str(tmp_path / "run")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield process, tmp_path / process.stdout.readline().strip()
        process.kill()


def test_a_draft_of_a_killed_process_goes_with_the_next_one(holder, tmp_path):
    process, draft = holder
    process.kill()
    process.wait()
    assert (draft / "half").is_file()
    with draft_of(tmp_path / "run") as mine:
        assert list(tmp_path.iterdir()) == [mine]
    assert list(tmp_path.iterdir()) == []


def test_a_draft_that_is_being_written_stays(holder, tmp_path):
    _, draft = holder
    clear_drafts(tmp_path)
    with draft_of(tmp_path / "run") as mine:
        assert sorted(tmp_path.iterdir()) == sorted([draft, mine])
    assert (draft / "half").is_file()


def test_drafts_of_other_folders_stay_unless_all_are_meant(tmp_path):
    other = tmp_path / ".runs.abc.part"
    other.mkdir()
    (tmp_path / ".run.abc").mkdir()
    (tmp_path / "run.part").mkdir()
    with draft_of(tmp_path / "run"):
        pass
    assert other.is_dir()
    clear_drafts(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".run.abc", "run.part"]


def test_a_folder_is_not_taken_for_another_one_whose_name_goes_on_after_a_dot(tmp_path):
    """A draft, and what was set aside, of `v1.1` are not of `v1`."""
    (tmp_path / ".v1.1.abc.part").mkdir()
    (tmp_path / ".v1.1.abc.old").mkdir()
    clear_drafts(tmp_path, "v1")
    restore(tmp_path / "v1")
    assert sorted(os.listdir(tmp_path)) == [".v1.1.abc.old", ".v1.1.abc.part"]
    clear_drafts(tmp_path, "v1.1")
    restore(tmp_path / "v1.1")
    assert os.listdir(tmp_path) == ["v1.1"]


@pytest.mark.parametrize("name", ["run", "v1.1", "a[1]*?", "a b"])
def test_whatever_its_folder_is_called_a_draft_is_found(tmp_path, name):
    (tmp_path / f".{name}.abc.part").mkdir()
    clear_drafts(tmp_path, name)
    assert os.listdir(tmp_path) == []


def test_a_draft_can_be_renamed_into_place(tmp_path):
    with draft_of(tmp_path / "run") as draft:
        assert draft.stat().st_mode & 0o777 == 0o755
        (draft / "whole").write_text("")
        draft.rename(tmp_path / "run")
    assert [path.name for path in tmp_path.rglob("*")] == ["run", "whole"]


def interrupted_at(line, work):
    """Do the work, and interrupt it before so many lines of its module; whether it came so far."""
    left = line

    def local(frame, event, _):
        nonlocal left
        left -= event == "line"
        if left < 0:
            raise KeyboardInterrupt
        return local

    def trace(frame, event, _):
        return local if frame.f_code.co_filename == drafts.__file__ else None

    sys.settrace(trace)
    try:
        work()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(None)
    return False


def test_a_signal_at_any_line_before_the_block_leaves_nothing(tmp_path):
    def work():
        with draft_of(tmp_path / "run"):
            sys.settrace(None)

    lines = 0
    while interrupted_at(lines, work):
        assert list(tmp_path.iterdir()) == []
        lines += 1
    assert lines > 15
