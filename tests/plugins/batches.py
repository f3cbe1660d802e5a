"""Runs that take no time, and a batch whose jobs are done in the test's own process."""

from collections.abc import Iterator, Sequence

from surgsim.compare.job import Job, do
from surgsim.compare.workers import Done


def short_run(duration_s: float = 0.2) -> tuple[str, ...]:
    """Settings that cut a shipped circle down to a small one of `duration_s`, without the theatre."""
    return (
        "theatre=false",
        f"task.duration_s={duration_s}",
        "task.ramp_s=0.1",
        "task.hold_start_s=0",
        "task.hold_end_s=0",
        "task.radius_m=0.002",
    )


class Here:
    """A runner that does the jobs in this process.

    Attributes:
        folders: Of the jobs that were begun.
    """

    def __init__(self) -> None:
        self.folders: list[str] = []

    def __call__(self, jobs: Sequence[Job], count: int) -> Iterator[Done]:
        for index, job in enumerate(jobs):
            self.folders.append(job.folder)
            yield Done(index=index, outcome=do(job))
