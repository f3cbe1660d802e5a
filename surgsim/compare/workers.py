"""Worker processes that survive each other's death."""

import multiprocessing
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from surgsim.compare.job import CRASHED, WORKER_DIED, DiskError, Job, attempt, write_failure
from surgsim.compiling import Compiling, listening, tell
from surgsim.errors import SurgsimError
from surgsim.runs.drafts import clear_drafts
from surgsim.runs.stop import held_back, leave_in_peace, obey_parent

TRIES = 2
_MOST_STILLBORN = 5
_PATIENCE_S = 10.0
_SPAWN = multiprocessing.get_context("spawn")


@dataclass
class _Worker:
    """A process and what it is doing."""

    process: Any
    pipe: Connection
    index: int | None = None
    began: bool = False


@dataclass(frozen=True, kw_only=True)
class Done:
    """A finished job.

    Attributes:
        index: Which of the jobs.
        outcome: Name of its outcome.
    """

    index: int
    outcome: str


def run_jobs(jobs: Sequence[Job], count: int) -> Iterator[Done]:
    """Do all jobs in `count` processes and yield each as it is finished.

    A worker that dies is replaced and its job tried once more; if that worker dies too, the run is written
    as failed. A full disk ends the batch: what is whole stays, and a later call with the rest goes on.

    Raises:
        SurgsimError: If the disk refuses a folder, or processes cannot start.
    """
    with kept_workers(count) as run:
        yield from run(jobs)


@contextmanager
def kept_workers(count: int) -> Iterator[Callable[[Sequence[Job]], Iterator[Done]]]:
    """What does jobs as `run_jobs`, again and again in the same `count` processes."""
    pool = _Pool()
    try:
        yield lambda jobs: pool.run(jobs, count)
    finally:
        pool.dismiss()


@dataclass
class _Pool:
    jobs: Sequence[Job] = ()
    waiting: deque[int] = field(default_factory=deque)
    workers: list[_Worker] = field(default_factory=list)
    tries: dict[int, int] = field(default_factory=dict)
    stillborn: int = 0

    @property
    def busy(self) -> bool:
        return any(worker.index is not None for worker in self.workers)

    def run(self, jobs: Sequence[Job], count: int) -> Iterator[Done]:
        """Do `jobs` in at most `count` processes, those that are there first."""
        self.jobs, self.waiting, self.tries = jobs, deque(range(len(jobs))), {}
        for worker in self.workers:
            self.assign(worker)
        while len(self.workers) < min(count, len(jobs)):
            self.hire()
        while self.busy:
            yield from self.collect()

    def hire(self) -> None:
        """Start a process, and give it the next job."""
        here, there = _SPAWN.Pipe()
        process = _SPAWN.Process(target=_serve, args=(there,), daemon=True)
        # Ctrl-C reaches every process of a terminal: not one that cannot take it yet.
        with held_back(), _script_hidden():
            process.start()
        there.close()
        worker = _Worker(process, here)
        self.workers.append(worker)
        self.assign(worker)

    def assign(self, worker: _Worker) -> None:
        """Give `worker` the next job, if there is one."""
        worker.index = None
        if self.waiting:
            index = self.waiting.popleft()
            self.tries[index] = self.tries.get(index, 0) + 1
            worker.index = index
            with suppress(OSError):  # it died while idle: `collect` sees its sentinel
                worker.pipe.send(self.jobs[index])

    def collect(self) -> list[Done]:
        """Wait until a worker answers or dies."""
        ready = wait([w.pipe for w in self.workers] + [w.process.sentinel for w in self.workers])
        done: list[Done] = []
        for worker in list(self.workers):
            if worker.pipe in ready:
                done.extend(self.answer(worker))
            elif worker.process.sentinel in ready:
                done.extend(self.bury(worker))
        return done

    def answer(self, worker: _Worker) -> list[Done]:
        """Take a worker's answer and give it the next job."""
        try:
            kind, text = worker.pipe.recv()
        except (EOFError, OSError):
            return self.bury(worker)
        if kind == "compiling":
            tell(text)
            return []
        if kind == "ready":
            worker.began, self.stillborn = True, 0
            return []
        index = worker.index
        if index is None:
            return []
        if kind == "disk":
            raise stopped(text)
        if kind == "error":
            record_failure(self.jobs[index], CRASHED, text)
            text = CRASHED
        self.assign(worker)
        return [Done(index=index, outcome=text)]

    def bury(self, worker: _Worker) -> list[Done]:
        """Replace a dead worker; its job is tried again, or given up."""
        self.workers.remove(worker)
        worker.pipe.close()
        worker.process.join()
        index, done, detail = worker.index, [], f"exit code {worker.process.exitcode}"
        if not worker.began:
            self.stillborn += 1
            if self.stillborn >= _MOST_STILLBORN:
                raise SurgsimError(f"worker processes end before they can begin ({detail})")
            if index is not None:  # not the job's fault
                self.tries[index] -= 1
        if index is not None:
            if self.tries[index] < TRIES:
                self.waiting.appendleft(index)
            else:
                record_failure(self.jobs[index], WORKER_DIED, detail)
                done = [Done(index=index, outcome=WORKER_DIED)]
        if self.waiting:
            self.hire()
        return done

    def dismiss(self) -> None:
        """End all processes: in order, or else by force; no draft of theirs is left."""
        for worker in self.workers:
            worker.pipe.close()
            worker.process.terminate()
        until = time.monotonic() + _PATIENCE_S
        for worker in self.workers:
            worker.process.join(max(0.0, until - time.monotonic()))
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()
            if worker.index is not None:
                folder = Path(self.jobs[worker.index].folder)
                with suppress(OSError):
                    clear_drafts(folder.parent, folder.name)


@contextmanager
def _script_hidden() -> Iterator[None]:
    """Keep a new process from running the caller's script again: workers need nothing of it.

    So a script without `if __name__ == "__main__"` can start them.
    """
    main = vars(sys.modules["__main__"])
    hidden: dict[str, Any] = {name: main.pop(name) for name in ("__file__", "__spec__") if name in main}
    main["__spec__"] = None
    try:
        yield
    finally:
        main.update(hidden)


def stopped(text: str) -> SurgsimError:
    """What ends a batch that cannot go on."""
    return SurgsimError(f"{text}; what is whole stays, --resume goes on with the rest")


def record_failure(job: Job, name: str, detail: str) -> None:
    """Write the folder of a job that ended without one.

    Raises:
        SurgsimError: If the disk refuses.
    """
    try:
        write_failure(job.scenario(), Path(job.folder), name, detail)
    except DiskError as error:
        raise stopped(str(error)) from error


def _serve(pipe: Connection) -> None:
    """A worker's life: jobs in, outcomes out, until the pipe closes or the parent is gone."""
    obey_parent()
    with suppress(OSError):
        pipe.send(("ready", ""))

    def forward(compiling: Compiling) -> None:
        with suppress(OSError):
            pipe.send(("compiling", compiling))

    while True:
        try:
            job = pipe.recv()
        except (EOFError, OSError):
            break
        try:
            with listening(forward):
                answer = attempt(job)
            pipe.send(answer)
        except OSError:
            break
    leave_in_peace()
