"""The files that say what surgsim is, to a person and to a machine: citation, changelog, types."""

import re
import subprocess
import tomllib
from pathlib import Path

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
