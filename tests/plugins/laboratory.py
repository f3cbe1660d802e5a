"""A laboratory of the tests: the package of `docs/submission.md`, and a protocol of short runs."""

import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from surgsim.compare.job import Job, do
from surgsim.compare.workers import Done
from surgsim.plugins import all_offers
from surgsim.protocol.definition import Protocol, load_protocol
from surgsim.protocol.entrants import entrant
from surgsim.protocol.freeze import freeze
from surgsim.protocol.runs import Store
from surgsim.protocol.score import Means, Wish, score, write_score
from surgsim.protocol.seeds import seeds_of
from surgsim.protocol.submit import submission
from surgsim.runs import part_origins

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "submission.md"
SHORT = {"type": "circle", "radius_m": 0.002, "duration_s": 0.2, "ramp_s": 0.05, "hold_end_s": 0.0}


def pages_files() -> dict[str, str]:
    """The files that the page has a person write, by path."""
    text = PAGE.read_text(encoding="utf-8")
    return dict(re.findall(r"^`(lab/[\w./]+)`:\n\n```\w+\n(.*?)```$", text, re.M | re.S))


def pages_commands() -> list[str]:
    """The commands that the page has a person type, in order."""
    text = PAGE.read_text(encoding="utf-8").split("## Install, try, score, submit, verify")[1]
    return re.search(r"```text\n(.*?)```", text, re.S)[1].splitlines()


def write_package(folder: Path) -> None:
    """The package as the page has it, below `folder`."""
    for name, text in pages_files().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def install(folder: Path, site: Path) -> None:
    """Install the package as the page says, into a folder of its own."""
    command = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", "install"]
    command += ["--no-index", "--no-build-isolation", "--no-deps", "--target", str(site), "./lab"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


@contextmanager
def installed(site: Path) -> Iterator[None]:
    """Within the block this process finds what is installed in `site`, and hashes it anew."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(site)
        all_offers.cache_clear()
        part_origins._told.cache_clear()
        yield
    all_offers.cache_clear()
    part_origins._told.cache_clear()
    for name in [name for name in sys.modules if name.partition(".")[0] == "lab_controller"]:
        del sys.modules[name]


def short_protocol(folder: Path, name: str = "short", **changes: object) -> Protocol:
    """A frozen protocol of seven runs of one arm, cut from the shipped one."""
    shipped = YAML(typ="safe").load(load_protocol("surgsim_v1").path)
    loads = shipped["generators"]["loads"]
    payload = {**loads["axes"]["payload"], "levels": [0.2, 0.5]}
    loads = {**loads, "base": {**loads["base"], "task": SHORT}, "seeds": 3, "level_seeds": 2}
    tree = {
        **shipped,
        "name": name,
        "arms": {"lwr4plus": shipped["arms"]["lwr4plus"], "panda": shipped["arms"]["panda"]},
        "generators": {"loads": {**loads, "axes": {"payload": payload}}},
        "tracks": {
            track: {**shipped["tracks"][track], "generators": ["loads"], "entries": ["pinv"], "baselines": []}
            for track in ("nominal", "port_tracked")
        },
        **changes,
    }
    path = folder / f"{name}.yaml"
    with path.open("w", encoding="utf-8") as file:
        YAML().dump(tree, file)
    protocol = load_protocol(str(path))
    freeze(protocol)
    return protocol


def here(jobs: Sequence[Job], count: int) -> Iterator[Done]:
    """Does runs in this process: what it has loaded serves them."""
    for index, job in enumerate(jobs):
        yield Done(index=index, outcome=do(job))


@dataclass(frozen=True, kw_only=True)
class Laboratory:
    """A score of the laboratory's controller.

    Attributes:
        folder: The laboratory's folder, with the package in `lab`.
        site: Where its package is installed.
        protocol: The protocol.
        score: Folder of the score.
        files: Contents of the bundle's files.
        archive: The bundle.
    """

    folder: Path
    site: Path
    protocol: Protocol
    score: Path
    files: Mapping[str, bytes]
    archive: bytes


@pytest.fixture(scope="session")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Laboratory:
    """The laboratory's controller, installed and scored as its page says, on short runs."""
    folder = tmp_path_factory.mktemp("laboratory")
    site = folder / "site"
    write_package(folder)
    install(folder, site)
    protocol = short_protocol(folder)
    with installed(site):
        wish = Wish(
            protocol=protocol,
            track="nominal",
            arms=("lwr4plus",),
            seeds=seeds_of(protocol, "development"),
            entrant=entrant(str(folder / "lab" / "lab.yaml")),
        )
        found = score(wish, Means(store=Store(folder=folder / "store"), runner=here))
        assert found is not None
        write_score(folder / "score", found)
        made = submission(folder / "score", protocol)
    assert made.findings == ()
    return Laboratory(
        folder=folder,
        site=site,
        protocol=protocol,
        score=folder / "score",
        files=made.bundle.files,
        archive=made.archive,
    )


@pytest.fixture
def at_the_laboratory(laboratory: Laboratory) -> Iterator[Laboratory]:
    """The same, and this process finds its package."""
    with installed(laboratory.site):
        yield laboratory
