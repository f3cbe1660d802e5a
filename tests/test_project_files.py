"""The files that say what surgsim is, to a person and to a machine: citation, changelog, types."""

import re
import subprocess
import tomllib
from pathlib import Path

import pytest
from ruamel.yaml import YAML

import surgsim

ROOT = Path(surgsim.__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_the_citation_holds_what_its_format_requires_and_names_this_version():
    citation = YAML(typ="safe").load((ROOT / "CITATION.cff").read_text())
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["cff-version"] == "1.2.0"
    assert citation["type"] == "software"
    assert all(author.get("name") or author.get("family-names") for author in citation["authors"])
    assert (citation["version"], citation["license"]) == (surgsim.__version__, PROJECT["license"])
    assert f"version = {{{surgsim.__version__}}}" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_changelog_has_the_form_of_keep_a_changelog():
    text = (ROOT / "CHANGELOG.md").read_text()
    assert text.startswith("# Changelog\n")
    versions = re.findall(r"^## (.+)$", text, re.M)
    assert versions[0] == "[Unreleased]"
    assert all(re.fullmatch(r"\[\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d", version) for version in versions[1:])
    kinds = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    assert set(re.findall(r"^### (.+)$", text, re.M)) <= kinds


def test_every_file_has_a_name_that_was_meant():
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", "-z"], capture_output=True, text=True)
    if listed.returncode != 0:  # not a checkout
        return
    names = [name for name in listed.stdout.split("\0") if name]
    assert [name for name in names if not re.fullmatch(r"[\w./+-]+", name)] == []


def test_the_package_says_that_it_is_typed():
    assert (ROOT / "surgsim" / "py.typed").is_file()


def test_the_workflow_runs_what_ci_runs_and_nobody_else_s_commands():
    flow = YAML(typ="safe").load((ROOT / ".github" / "workflows" / "tests.yml").read_text("utf-8"))
    jobs = flow["jobs"]
    commands = [step["run"] for job in jobs.values() for step in job["steps"] if "run" in step]
    assert any(".ci/run" in command for command in commands)
    assert flow["permissions"] == {}
    assert all(job["permissions"] == {"contents": "read"} and job["timeout-minutes"] for job in jobs.values())


def test_the_hooks_are_what_make_check_runs():
    hooks = YAML(typ="safe").load((ROOT / ".pre-commit-config.yaml").read_text("utf-8"))["repos"][0]["hooks"]
    checks = (ROOT / "Makefile").read_text("utf-8").split("\ncheck:")[1].split("\n\n")[0]
    for hook in hooks:
        words = hook["entry"].removeprefix(".venv/bin/").replace(" --force-exclude", "")
        assert words in checks.replace(" --check", ""), f"{hook['id']} is not in make check"


@pytest.mark.parametrize("name", ["fault", "part"])
def test_a_form_for_issues_has_what_its_format_requires(name):
    form = YAML(typ="safe").load((ROOT / ".github" / "ISSUE_TEMPLATE" / f"{name}.yml").read_text("utf-8"))
    assert {"name", "description", "body"} <= set(form)
    fields = [field["id"] for field in form["body"]]
    assert len(fields) == len(set(fields))
    assert all(field["attributes"]["label"] for field in form["body"])


def test_make_says_at_once_that_it_cannot_work_in_a_folder_with_a_space(tmp_path):
    folder = tmp_path / "my surgsim"
    folder.mkdir()
    (folder / "Makefile").write_text((ROOT / "Makefile").read_text("utf-8"), "utf-8")
    done = subprocess.run(["make", "help"], cwd=folder, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "has a space" in done.stderr
    assert "pip install ." in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["my surgsim"]
