"""Which commit a result comes from, and with which local changes."""

import re
import subprocess

import pytest

from surgsim.runs.provenance import commit_of

CLEAN = r"[0-9a-f]{40}"
DIRTY = r"[0-9a-f]{40}\+dirty\.[0-9a-f]{8}"


@pytest.fixture
def checkout(tmp_path):
    """A git checkout with a file in every folder that counts, and one that does not."""
    for name in ("surgsim/a.py", "assets/a.xml", "scenarios/a.yaml", "pyproject.toml", "README.md"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("old\n")
    (tmp_path / ".gitignore").write_text("*.pyc\n")
    who = ["-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false"]
    for words in (["init", "-q"], ["add", "."], [*who, "commit", "-q", "-m", "first"]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    return tmp_path


def test_a_clean_checkout_is_its_commit(checkout):
    assert re.fullmatch(CLEAN, commit_of(checkout))


@pytest.mark.parametrize(
    "name",
    [
        "README.md",
        "notes.txt",
        "runs/new.json",
        "surgsim/a.pyc",
        "surgsim/notes.txt",
        "surgsim/cli/a.py",
        "surgsim/report/a.py",
        "scenarios/a.yaml",
        "pyproject.toml",
    ],
)
def test_what_cannot_change_a_result_does_not_count(checkout, name):
    (checkout / name).parent.mkdir(exist_ok=True)
    (checkout / name).write_text("new\n")
    assert re.fullmatch(CLEAN, commit_of(checkout))


@pytest.mark.parametrize(
    "name", ["surgsim/a.py", "assets/a.xml", "surgsim/new.py", "surgsim/control/new.py", "assets/new.xml"]
)
def test_a_change_of_what_counts_is_told_by_its_hash(checkout, name):
    def with_content(text):
        (checkout / name).parent.mkdir(exist_ok=True)
        (checkout / name).write_text(text)
        found = commit_of(checkout)
        assert re.fullmatch(DIRTY, found)
        return found

    one, other, one_again = (with_content(text) for text in ("one\n", "other\n", "one\n"))
    assert one == one_again != other


def test_staged_changes_count_too_and_names_matter(checkout):
    (checkout / "surgsim/b.py").write_text("new\n")
    untracked = commit_of(checkout)
    (checkout / "surgsim/b.py").rename(checkout / "surgsim/c.py")
    assert re.fullmatch(DIRTY, commit_of(checkout))
    assert commit_of(checkout) != untracked
    subprocess.run(["git", "add", "."], cwd=checkout, check=True)
    assert re.fullmatch(DIRTY, commit_of(checkout))


def test_a_folder_that_is_no_checkout_has_none(tmp_path):
    assert commit_of(tmp_path) is None
