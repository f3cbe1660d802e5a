"""Runs of candidates: done by workers, kept in a file as each is finished, and never done twice."""

import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from surgsim.compare.job import REFUSED, Job
from surgsim.compare.workers import Done
from surgsim.errors import SurgsimError
from surgsim.recording.files import replacing, write_file
from surgsim.recording.sealed import read_sealed
from surgsim.runs.provenance import provenance_of
from surgsim.scenario.arms import Experiment
from surgsim.tuning.cost import ERRORS, SHARES, Trial

RunJobs = Callable[[Sequence[Job]], Iterator[Done]]
"""Does jobs, and yields each as it is finished."""
Report = Callable[[str], None]
"""Called with the outcome of each run that is done."""

METRICS = (*ERRORS, *SHARES, "torque_rate_median_nm_per_s", "torque_total_mean_nm")
"""Metrics that are kept of every run, of several arms those of each with its name before them."""
_KEYS = {*Trial.__dataclass_fields__, "scenario_sha256", "code_sha256"}


@dataclass(frozen=True, kw_only=True)
class Case:
    """A run that is wanted.

    Attributes:
        scenario: What is run; None where the scenario refuses the candidate.
        name: Name of the scenario.
        seed: Its seed.
        told: What the file says of it beside: the candidate, its gains.
        refusal: Why there is no scenario.
    """

    scenario: Experiment | None
    name: str
    seed: int
    told: Mapping[str, Any]
    refusal: str = ""


class Trials:
    """Runs and their file, `evaluations.jsonl`: a line for each, written when it is finished.

    A line is known by the hashes of its scenario and of the code, so that a search which asks again for what
    is there gets it from the file. A last line that a killed process left cut is passed over.

    Args:
        file: The file; what it holds is read.
        folder: Where runs are written, and removed again.
        run_jobs: What does them.
    """

    def __init__(self, file: Path, folder: Path, run_jobs: RunJobs) -> None:
        self._file, self._folder, self._run_jobs = file, folder, run_jobs
        self._lines = _read(file)
        self._known = {(line["scenario_sha256"], line["code_sha256"]): line for line in self._lines}
        self._codes: dict[tuple[str, int], str] = {}
        self.done = 0
        if self._lines:
            _write(file, self._lines)  # without a line that is cut

    def of(self, cases: Sequence[Case], report: Report) -> list[Trial]:
        """The run of each case, in their order.

        Raises:
            SurgsimError: If the disk refuses, or processes cannot start.
        """
        found: dict[int, Trial] = {}
        wanted: dict[tuple[str, str], list[int]] = {}
        for place, case in enumerate(cases):
            if case.scenario is None:
                found[place] = _refused(case)
            elif (key := self._key(case, case.scenario)) in self._known:
                found[place] = _trial(self._known[key])
            else:
                wanted.setdefault(key, []).append(place)
        for trial in found.values():
            report(trial.outcome)
        for key, line in self._run({key: cases[places[0]] for key, places in wanted.items()}):
            self._keep(key, line)
            for place in wanted[key]:
                found[place] = _trial(line)
                report(line["outcome"])
        return [found[place] for place in range(len(cases))]

    def _key(self, case: Case, scenario: Experiment) -> tuple[str, str]:
        """Hashes of scenario and code; a candidate changes numbers alone, and so not the code."""
        whose = (case.name, case.seed)
        if whose not in self._codes:
            self._codes[whose] = provenance_of(scenario)["code_sha256"]
        return scenario.sha256(), self._codes[whose]

    def _run(
        self, wanted: Mapping[tuple[str, str], Case]
    ) -> Iterator[tuple[tuple[str, str], dict[str, Any]]]:
        """Each wanted run with its line, as it is finished."""
        keys = list(wanted)
        scenarios = [case.scenario for case in wanted.values() if case.scenario is not None]
        jobs = [
            Job(scenario_json=scenario.model_dump_json(), folder=str(self._folder / key[0]), record=False)
            for key, scenario in zip(keys, scenarios, strict=True)
        ]
        for done in self._run_jobs(jobs) if jobs else ():
            key, folder = keys[done.index], Path(jobs[done.index].folder)
            yield key, _line(wanted[key], key, _summary(folder))
            shutil.rmtree(folder, ignore_errors=True)
            self.done += 1

    def _keep(self, key: tuple[str, str], line: dict[str, Any]) -> None:
        """Add a line to the file."""
        self._known[key] = line
        self._lines.append(line)
        try:
            with self._file.open("a", encoding="utf-8") as file:
                file.write(_text(line))
        except OSError as error:
            raise SurgsimError(f"{self._file}: cannot be written: {error.strerror or error}") from error


def _summary(folder: Path) -> dict[str, Any]:
    try:
        return read_sealed(folder / "metrics.json")
    except (OSError, ValueError) as error:
        raise SurgsimError(f"{folder}: a run is missing; it was removed while others ran") from error


def _line(case: Case, key: tuple[str, str], summary: Mapping[str, Any]) -> dict[str, Any]:
    outcome, metrics = summary["outcome"], summary["metrics"]
    arms = [f"{arm}_" for arm in summary.get("arms") or ()] or [""]
    trial = Trial(
        scenario=case.name,
        seed=case.seed,
        outcome=outcome["name"],
        t_s=outcome["t_s"],
        detail=outcome["detail"],
        metrics={f"{of}{name}": metrics.get(f"{of}{name}") for of in arms for name in METRICS},
    )
    return {**case.told, **asdict(trial), "scenario_sha256": key[0], "code_sha256": key[1]}


def _trial(line: Mapping[str, Any]) -> Trial:
    return Trial(**{name: line[name] for name in Trial.__dataclass_fields__})


def _refused(case: Case) -> Trial:
    return Trial(
        scenario=case.name, seed=case.seed, outcome=REFUSED, t_s=0.0, detail=case.refusal, metrics={}
    )


def _text(line: Mapping[str, Any]) -> str:
    return json.dumps(line) + "\n"


def _read(file: Path) -> list[dict[str, Any]]:
    """The lines of a file, none if it is not there.

    Raises:
        SurgsimError: If one that is not the last is damaged.
    """
    try:
        *whole, _ = file.read_text(encoding="utf-8").split("\n")
        lines = [json.loads(text) for text in whole]
        for number, line in enumerate(lines, start=1):
            if missing := _KEYS.difference(line):
                raise ValueError(f"line {number} has no {min(missing)}")
    except FileNotFoundError:
        return []
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SurgsimError(f"{file}: cannot be read: {error}") from error
    return lines


def _write(file: Path, lines: Sequence[Mapping[str, Any]]) -> None:
    with replacing(file) as draft:
        write_file(draft, "".join(map(_text, lines)))
