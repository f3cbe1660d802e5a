"""A release: one commit that names the version everywhere, and its tag."""

import datetime
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPT = ROOT / ".ci" / "release"
CHANGES = """# Changelog

## [Unreleased]

### Added

- A thing.

## [0.1.0] - 2026-01-01

- The first.
"""


def git(root, *words):
    done = subprocess.run(["git", "-C", str(root), *words], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.fixture
def project(tmp_path):
    """A project of three files and the script, on main."""
    root = tmp_path / "project"
    (root / "surgsim").mkdir(parents=True)
    (root / "surgsim" / "__init__.py").write_text('"""Doc."""\n__version__ = "0.1.0"\n', encoding="utf-8")
    (root / "CITATION.cff").write_text((ROOT / "CITATION.cff").read_text("utf-8"), encoding="utf-8")
    (root / "CHANGELOG.md").write_text(CHANGES, encoding="utf-8")
    (root / "README.md").write_text("@software{surgsim, version = {0.1.0}}\n", encoding="utf-8")
    (root / ".ci").mkdir()
    (root / ".ci" / "release").write_bytes(SCRIPT.read_bytes())
    git(tmp_path, "init", "--quiet", "--initial-branch", "main", str(root))
    git(root, "config", "user.name", "Somebody")
    git(root, "config", "user.email", "somebody@example.org")
    git(root, "add", ".")
    git(root, "commit", "--quiet", "--message", "Begin")
    return root


def release(root, *words):
    return subprocess.run(
        [sys.executable, str(root / ".ci" / "release"), *words], capture_output=True, text=True, timeout=60
    )


def test_a_release_is_one_commit_and_its_tag(project):
    done = release(project, "0.2.0")
    assert done.returncode == 0, done.stderr
    today = datetime.datetime.now(datetime.UTC).date()
    assert '__version__ = "0.2.0"' in (project / "surgsim" / "__init__.py").read_text("utf-8")
    citation = (project / "CITATION.cff").read_text("utf-8")
    assert f"\nversion: 0.2.0\ndate-released: {today}\n" in citation
    changes = (project / "CHANGELOG.md").read_text("utf-8")
    assert f"## [Unreleased]\n\n## [0.2.0] - {today}\n\n### Added\n\n- A thing.\n\n## [0.1.0]" in changes
    assert "version = {0.2.0}" in (project / "README.md").read_text("utf-8")
    assert git(project, "status", "--porcelain") == ""
    assert git(project, "log", "-1", "--format=%s") == "Release 0.2.0"
    assert "- A thing." in git(project, "tag", "--list", "--format=%(contents)", "v0.2.0")


def test_a_second_release_dates_the_citation_again(project):
    assert release(project, "0.2.0").returncode == 0
    changes = project / "CHANGELOG.md"
    changes.write_text(
        changes.read_text("utf-8").replace("[Unreleased]\n", "[Unreleased]\n\n- More.\n"), "utf-8"
    )
    git(project, "commit", "--quiet", "--all", "--message", "More")
    assert release(project, "0.3.0").returncode == 0
    assert (project / "CITATION.cff").read_text("utf-8").count("date-released") == 1


def test_a_dry_run_writes_nothing(project):
    done = release(project, "0.2.0", "--dry-run")
    assert done.returncode == 0
    assert "- A thing." in done.stdout
    assert git(project, "status", "--porcelain") == ""
    assert git(project, "tag") == ""


@pytest.mark.parametrize(
    ("words", "before", "told"),
    [
        (("two",), (), "'two' is no version"),
        (("0.1.0",), (), "0.1.0 is not greater than 0.1.0"),
        (("0.2.0",), ("tag", "v0.2.0"), "v0.2.0 is there already"),
        (("0.2.0",), ("checkout", "--quiet", "-b", "side"), "made on main, not on side"),
        (("0.2.0",), ("mv", "CHANGELOG.md", "NEWS.md"), "not committed"),
    ],
    ids=["no version", "not greater", "there already", "another branch", "not committed"],
)
def test_what_is_no_release_is_refused_in_one_line(project, words, before, told):
    if before:
        git(project, *before)
    done = release(project, *words)
    assert done.returncode == 2
    assert told in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_changelog_without_news_is_refused(project):
    (project / "CHANGELOG.md").write_text(CHANGES.replace("### Added\n\n- A thing.\n", ""), encoding="utf-8")
    git(project, "commit", "--quiet", "--all", "--message", "Nothing new")
    done = release(project, "0.2.0")
    assert (done.returncode, "says nothing under [Unreleased]" in done.stderr) == (2, True)
