"""Runs of a batch on a Ray cluster.

A run is done in a temporary folder of whichever node takes it; its files come back to the driver, which
writes them as a whole folder. So the nodes share nothing, and a node killed in the middle loses no run: Ray
tries it again elsewhere.
"""

import logging
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from surgsim.compare.job import CRASHED, WORKER_DIED, Job, attempt
from surgsim.compare.workers import Done, record_failure, stopped
from surgsim.errors import SurgsimError
from surgsim.packages import require
from surgsim.recording.files import write_file
from surgsim.runs.folder import whole_folder

RETRIES = 3
_AHEAD = 2


def ray_runner(address: str | None) -> Any:
    """A runner for `surgsim.compare.engine.compare` on the cluster at `address`; None starts a local one.

    Raises:
        SurgsimError: If ray is not installed, or the cluster cannot be reached.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    require("--engine ray needs", "ray")
    import ray

    ours = not ray.is_initialized()
    try:
        if ours:
            ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
    except (ConnectionError, ValueError, RuntimeError, ray.exceptions.RayError) as error:
        raise SurgsimError(f"no Ray cluster at {address or 'this machine'}: {error}") from error

    def run(jobs: Sequence[Job], count: int) -> Iterator[Done]:
        """As `run_jobs`; the cluster decides how many run at once. It is left afterwards."""
        try:
            yield from _run(ray, jobs)
        finally:
            if ours:
                ray.shutdown()

    return run


def _run(ray: Any, jobs: Sequence[Job]) -> Iterator[Done]:
    remote = ray.remote(num_cpus=1, max_retries=RETRIES)(perform)
    waiting = iter(range(len(jobs)))
    pending: dict[Any, int] = {}

    def submit() -> None:
        most = max(1, _AHEAD * int(ray.cluster_resources().get("CPU", 1)))
        while len(pending) < most and (index := next(waiting, None)) is not None:
            pending[remote.remote(jobs[index])] = index

    submit()
    while pending:
        ready, _ = ray.wait(list(pending), num_returns=1)
        index = pending.pop(ready[0])
        yield Done(index=index, outcome=_collect(ray, ready[0], jobs[index]))
        submit()


def perform(job: Job) -> tuple[str, str, dict[str, bytes]]:
    """Do a job in a temporary folder: as `surgsim.compare.job.attempt`, with the folder's files."""
    try:
        folder = tempfile.mkdtemp(prefix="surgsim-")
    except OSError as error:
        return "disk", f"cannot write {tempfile.gettempdir()}: {error.strerror or error}", {}
    try:
        kind, text = attempt(replace(job, folder=str(Path(folder) / "run")))
        run = Path(folder) / "run"
        return kind, text, {path.name: path.read_bytes() for path in run.iterdir()} if kind == "done" else {}
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _collect(ray: Any, reference: Any, job: Job) -> str:
    """Write a finished job's folder; one whose process died at every try is a failed run."""
    try:
        kind, text, files = ray.get(reference)
    except (ray.exceptions.WorkerCrashedError, ray.exceptions.OutOfMemoryError) as error:
        record_failure(job, WORKER_DIED, type(error).__name__)
        return WORKER_DIED
    except ray.exceptions.RayError as error:
        reason = str(error).strip().splitlines()[0]
        raise stopped(f"the cluster cannot do the runs: {type(error).__name__}: {reason}") from error
    if kind == "disk":
        raise stopped(f"a node's disk refuses: {text}")
    if kind == "error":
        record_failure(job, CRASHED, text)
        return CRASHED
    try:
        with whole_folder(Path(job.folder)) as draft:
            for name, content in files.items():
                write_file(draft / name, content)
    except SurgsimError as error:
        raise stopped(str(error)) from error
    return str(text)
