"""One run of a batch, as a worker does it: from a scenario to a whole folder, whatever happens."""

import json
import traceback
from dataclasses import dataclass, field
from pathlib import Path

from surgsim.compare.columns import Table
from surgsim.control.external.given_commands import given, giving
from surgsim.errors import Outcome, SurgsimError
from surgsim.runs.folder import execute, summary_of, whole_folder, write_run, write_summary
from surgsim.scenario.arms import Experiment, experiment_of
from surgsim.verdict import unfinished

REFUSED = "refused"
WORKER_DIED = "worker_died"
CRASHED = "crashed"


@dataclass(frozen=True, kw_only=True)
class Job:
    """A run to be done.

    Attributes:
        scenario_json: The resolved scenario.
        folder: The run's folder.
        record: Whether the recording is written.
        externals: Names and commands of external controllers; those that are given where the job is made.
    """

    scenario_json: str
    folder: str
    record: bool
    externals: tuple[tuple[str, str], ...] = field(default_factory=given)

    def scenario(self) -> Experiment:
        """The scenario."""
        return experiment_of(json.loads(self.scenario_json))


class DiskError(Exception):
    """The disk refuses a folder: the run is not done, and another one would fare no better."""


def do(job: Job) -> str:
    """Run the job and write its folder; what cannot be started is written as a failed run.

    Returns:
        Name of the outcome.

    Raises:
        DiskError: If the folder cannot be written.
    """
    scenario, folder = job.scenario(), Path(job.folder)
    try:
        result = execute(scenario)
    except SurgsimError as error:
        write_failure(scenario, folder, REFUSED, str(error))
        return REFUSED
    try:
        write_run(scenario, result, folder, record=job.record)
    except SurgsimError as error:
        raise DiskError(str(error)) from error
    return result.trace.meta.ending.outcome.name.lower()


def attempt(job: Job) -> tuple[str, str]:
    """Do the job in a process that is to outlive it.

    Returns:
        `done` and the outcome's name; `disk` and why the folder cannot be written; or `error` and the end
        of the traceback: a bug is a row of the table, not the end of the batch.
    """
    try:
        with giving(dict(job.externals)):
            return "done", do(job)
    except DiskError as error:
        return "disk", str(error)
    except Exception:
        return "error", traceback.format_exc(limit=-3)


def write_failure(scenario: Experiment, folder: Path, name: str, detail: str) -> None:
    """Write the folder of a run that gave no trace: its scenario, and an outcome without metrics.

    Raises:
        DiskError: If the folder cannot be written.
    """
    outcome = {"name": name, "sentence": _SENTENCES[name], "t_s": 0.0, "detail": detail, "data": {}}
    try:
        with whole_folder(folder) as draft:
            write_summary(draft, scenario, summary_of(scenario, outcome, unfinished(name), {}, 0.0))
    except SurgsimError as error:
        raise DiskError(str(error)) from error


_SENTENCES = {
    REFUSED: "The scenario could not be started.",
    WORKER_DIED: "The process that ran it died at every try.",
    CRASHED: "The run raised an error inside surgsim: a bug.",
}
BROKEN = frozenset({WORKER_DIED, CRASHED})
"""Ways of ending that are faults of surgsim or the machine, not results."""
OUTCOMES = frozenset({*(outcome.name.lower() for outcome in Outcome), *_SENTENCES})
"""Every way in which a run of a batch can end."""


def broken(table: Table) -> list[str]:
    """Ids of the runs in a batch's table that crashed or whose worker died."""
    pairs = zip(table["run_id"], table["outcome"], strict=True)
    return [str(run_id) for run_id, outcome in pairs if outcome in BROKEN]
