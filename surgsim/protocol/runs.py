"""Finished runs, kept by their content: what did not change is never run again."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from llvmlite import binding
from numba import config

from surgsim.compare.job import BROKEN, Job
from surgsim.compare.workers import Done
from surgsim.errors import SurgsimError
from surgsim.protocol.canonical import sha256_of
from surgsim.protocol.cells import Cell
from surgsim.recording.contents import fault_of
from surgsim.recording.folders import make_folder
from surgsim.recording.sealed import read_sealed
from surgsim.runs.drafts import clear_drafts
from surgsim.runs.exchange import restore_all
from surgsim.runs.provenance import provenance_of
from surgsim.scenario.schema import Scenario

Report = Callable[[int, int, str], None]
Runner = Callable[[Sequence[Job], int], Iterator[Done]]
Summary = Mapping[str, Any]
"""Content of a run's `metrics.json`."""
_COMPILERS = ("numba", "llvmlite")


def run_key(scenario: Scenario) -> str:
    """The key of a run: hash of its scenario, the sources (kernels and assets among them), and the versions.

    Packages that gave the scenario a part, files of policies and what external controllers declare count too.
    """
    told = provenance_of(scenario)
    return key_of(told["scenario_sha256"], told["code_sha256"], compilers())


def key_of(scenario_sha256: str, code_sha256: str, compilers: Mapping[str, str]) -> str:
    """The key of a run, of what it follows from."""
    return sha256_of({"scenario": scenario_sha256, "code": code_sha256, "compilers": dict(compilers)})


def compilers() -> dict[str, str]:
    """Versions of what compiles the kernels."""
    return {name: version(name) for name in _COMPILERS}


def cpu() -> str:
    """Name of the processor that kernels are compiled for."""
    named: str | None = config.CPU_NAME  # type: ignore[attr-defined]  # made when numba starts
    return named or str(binding.get_host_cpu_name())


@dataclass(frozen=True, kw_only=True)
class Store:
    """A folder of finished runs, each in a folder called by its key.

    Attributes:
        folder: The folder.
    """

    folder: Path

    def place(self, key: str) -> Path:
        """The folder of the run with that key."""
        return self.folder / key[:2] / key

    def summary(self, key: str, scenario: Scenario) -> Summary | None:
        """What the run with that key gave; None if it is not there, or not as it was written."""
        place = self.place(key)
        try:
            found = read_sealed(place / "metrics.json")
            same = found["provenance"]["scenario_sha256"] == scenario.sha256()
            return found if same and not fault_of(place, found) else None
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def prepare(self) -> None:
        """Make the folder, and clear away what killed runs left half done.

        Raises:
            SurgsimError: If the disk refuses.
        """
        try:
            make_folder(self.folder)
            for parent in self.folder.iterdir():
                if parent.is_dir():
                    clear_drafts(parent)
                    restore_all(parent)
        except OSError as error:
            raise SurgsimError(f"cannot write {self.folder}: {error.strerror or error}") from error


@dataclass(frozen=True, kw_only=True)
class Found:
    """A cell with its run.

    Attributes:
        cell: The cell.
        key: The run's key; empty where the controller does not fit the scenario.
        summary: What the run gave; None where it was not run.
    """

    cell: Cell
    key: str
    summary: Summary | None


def run_cells(
    asked: Sequence[Cell],
    store: Store,
    runner: Runner,
    jobs: int,
    report: Report | None = None,
    shard: tuple[int, int] = (1, 1),
) -> list[Found] | None:
    """The runs of `asked`: those that the store lacks are run, each written as soon as it is done.

    A run that a fault of surgsim or of the machine ended is run again.

    Returns:
        All of them in order; None while runs of other shards are missing.

    Raises:
        SurgsimError: If the disk refuses, or processes cannot start.
    """
    store.prepare()
    keys = [run_key(cell.scenario) if cell.scenario is not None else "" for cell in asked]
    scenarios = {
        key: cell.scenario for key, cell in zip(keys, asked, strict=True) if cell.scenario is not None
    }
    kept = {key: found for key, found in _kept(store, scenarios)}
    i, n = shard
    ours = [key for key in list(scenarios)[i - 1 :: n] if key not in kept]
    work = [
        Job(scenario_json=scenarios[key].model_dump_json(), folder=str(store.place(key)), record=False)
        for key in ours
    ]
    done = len(list(scenarios)[i - 1 :: n]) - len(ours)
    for count, result in enumerate(runner(work, jobs) if work else (), start=done + 1):
        if report is not None:
            report(count, done + len(ours), result.outcome)
    for key, scenario in scenarios.items():
        summary = kept.get(key) or store.summary(key, scenario)
        if summary is None:
            return None
        kept[key] = summary
    return [Found(cell=cell, key=key, summary=kept.get(key)) for key, cell in zip(keys, asked, strict=True)]


def _kept(store: Store, scenarios: Mapping[str, Scenario]) -> Iterator[tuple[str, Summary]]:
    for key, scenario in scenarios.items():
        summary = store.summary(key, scenario)
        if summary is not None and summary["outcome"]["name"] not in BROKEN:
            yield key, summary
