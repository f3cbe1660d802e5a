"""Which code a run comes from is told without git: surgsim's sources, other packages, a policy's file."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import surgsim
from surgsim.control.policies.registry import offering
from surgsim.plugins import all_offers
from surgsim.runs import part_origins, sources
from surgsim.runs.provenance import code_difference, provenance_of

ROOT = Path(surgsim.__file__).parents[1]
HASH = "from surgsim.runs.sources import sources_sha256; print(sources_sha256())"


def hash_in(folder: Path) -> str:
    command = [sys.executable, "-c", HASH]
    done = subprocess.run(
        command, cwd=folder, env={"PYTHONPATH": str(folder)}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_the_hash_is_that_of_what_can_change_a_run_and_git_is_not_asked(tmp_path, monkeypatch):
    for name in ("surgsim", "assets"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    package = tmp_path / "surgsim"
    monkeypatch.setattr(sources, "ROOT", package)
    monkeypatch.setattr(sources, "resource_dir", lambda name: tmp_path / name)

    def found():
        sources.sources_sha256.cache_clear()
        return sources.sources_sha256()

    try:
        first = found()
        assert first == hash_in(tmp_path)
        for name in ("cli/run.py", "report/write.py", "notes.txt", "__pycache__/x.py"):
            (package / name).parent.mkdir(exist_ok=True)
            (package / name).write_text("changed", encoding="utf-8")
            assert found() == first, name
        seen = {first}
        for name in (
            "surgsim/control/controller.py",
            "surgsim/new.py",
            "assets/robots/lwr4plus/lwr4plus.xml",
        ):
            (tmp_path / name).write_text("changed", encoding="utf-8")
            seen.add(found())
        (package / "new.py").rename(package / "newer.py")
        seen.add(found())
        assert len(seen) == 5
    finally:
        sources.sources_sha256.cache_clear()


@pytest.fixture
def policy_package(tmp_path, monkeypatch):
    """A package with a policy and a file of weights, as an installed one, and how to hash it anew."""
    folder = tmp_path / "some_policies"
    folder.mkdir()
    (folder / "__init__.py").write_text("", encoding="utf-8")
    (folder / "mine.py").write_text("def act(seen):\n    return [0.0, 0.0, 0.0]\n", encoding="utf-8")
    (folder / "weights.bin").write_bytes(b"1")
    info = tmp_path / "some_policies-1.5.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: some-policies\nVersion: 1.5\n", encoding="utf-8"
    )
    (info / "entry_points.txt").write_text(
        "[surgsim.policies]\nmine = some_policies.mine:act\n", encoding="utf-8"
    )
    monkeypatch.syspath_prepend(tmp_path)
    all_offers.cache_clear()
    yield folder
    all_offers.cache_clear()
    for name in [name for name in sys.modules if name.partition(".")[0] == "some_policies"]:
        del sys.modules[name]
    part_origins._told.cache_clear()


def test_a_package_that_gave_a_part_is_told_with_version_and_hash_and_a_policy_with_its_file(
    policy_package, scenario
):
    mine = scenario("controller.resolver={type: policy, name: mine}")
    assert provenance_of(scenario())["plugins"] == {}
    first = provenance_of(mine)
    assert first["plugins"]["some_policies"]["version"] == "1.5"
    assert set(first["policies"]) == {"mine"}
    part_origins._told.cache_clear()
    (policy_package / "weights.bin").write_bytes(b"2")
    second = provenance_of(mine)
    assert second["code_sha256"] != first["code_sha256"]
    assert code_difference(first, second) == "package some_policies"
    (policy_package / "mine.py").write_text("def act(seen):\n    return [0.0, 0.0, 0.1]\n", encoding="utf-8")
    assert code_difference(second, provenance_of(mine)) == "policy mine"


def test_a_policy_of_one_process_is_told_by_the_file_that_it_stands_in(scenario):
    def still(seen):
        return [0.0, 0.0, 0.0]

    with offering("still", still):
        told = provenance_of(scenario("controller.resolver={type: policy, name: still}"))
    assert len(told["policies"]["still"]) == 64


def test_a_difference_is_put_into_words():
    parts = {"plugins": {}, "policies": {}, "externals": {}}
    old = {"sources_sha256": "a", "packages": {"numpy": "1"}, **parts}
    new = {"sources_sha256": "b", "packages": {"numpy": "2", "rerun-sdk": "1"}, **parts}
    assert code_difference(old, new) == "sources of surgsim, numpy 1 not 2"
    told = {"mine": {"name": "lab", "version": "2"}}
    assert code_difference(old, {**old, "externals": told}) == "external controller mine"
    assert code_difference(old, old) == ""
