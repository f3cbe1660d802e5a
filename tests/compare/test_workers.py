"""Worker processes: the order of the runs does not matter, and the death of a worker costs no other run."""

import json
import multiprocessing
import os
import signal
from pathlib import Path

import pytest

from surgsim.compare import workers
from surgsim.compare.job import CRASHED, WORKER_DIED, Job, do
from surgsim.compare.workers import kept_workers, run_jobs
from surgsim.errors import SurgsimError
from surgsim.metrics.timing import TIMING_METRICS

KILL = f"__import__('os').kill(__import__('os').getpid(), {int(signal.SIGKILL)})"


class Trap(Job):
    """A job of which the worker receives the value of `code`, an expression."""

    code: str = ""

    def __reduce__(self):
        return (eval, (self.code,))


def trap(job, code):
    made = Trap(scenario_json=job.scenario_json, folder=job.folder, record=job.record)
    object.__setattr__(made, "code", code)
    return made


def as_code(job, **changes):
    arguments = ", ".join(f"{key}={value!r}" for key, value in {**vars(job), **changes}.items())
    return f"__import__('surgsim.compare.job').compare.job.Job({arguments})"


@pytest.fixture
def jobs(scenario, tmp_path):
    """Factory of short jobs, seeds 0 and up, below a folder."""

    def make(count, below="runs"):
        return [
            Job(
                scenario_json=scenario(
                    "disturbances=[{type: payload, spread: 0.5}]", seed=i
                ).model_dump_json(),
                folder=str(tmp_path / below / str(i)),
                record=False,
            )
            for i in range(count)
        ]

    return make


def metrics(job):
    summary = json.loads((Path(job.folder) / "metrics.json").read_text())
    kept = {name: value for name, value in summary["metrics"].items() if name not in TIMING_METRICS}
    return summary["seed"], summary["outcome"], kept


def detail(job):
    return json.loads((Path(job.folder) / "metrics.json").read_text())["outcome"]


def test_kept_workers_do_one_batch_after_another_and_one_that_has_died_between_is_replaced(jobs):
    with kept_workers(2) as run:
        first = {done.index: done.outcome for done in run(jobs(2, "first"))}
        processes = set(multiprocessing.active_children())
        second = {done.index: done.outcome for done in run(jobs(3, "second"))}
        assert set(multiprocessing.active_children()) == processes
        victim = min(processes, key=lambda process: process.pid)
        os.kill(victim.pid, signal.SIGKILL)
        victim.join()
        third = {done.index: done.outcome for done in run(jobs(2, "third"))}
        assert list(run([])) == []
    assert (first, second) == ({0: "completed", 1: "completed"}, dict.fromkeys(range(3), "completed"))
    assert third == first
    assert [metrics(job) for job in jobs(2, "first")] == [metrics(job) for job in jobs(2, "third")]
    assert multiprocessing.active_children() == []


def test_neither_the_order_nor_the_process_changes_a_run(jobs):
    alone = jobs(4, "alone")
    assert [do(job) for job in alone] == ["completed"] * 4
    shuffled = jobs(4, "shuffled")
    order = [2, 0, 3, 1]
    done = list(run_jobs([shuffled[i] for i in order], 2))
    assert sorted(each.index for each in done) == list(range(4))
    assert {each.outcome for each in done} == {"completed"}
    assert [metrics(job) for job in shuffled] == [metrics(job) for job in alone]
    assert len({metrics(job)[2]["tip_error_rms_mm"] for job in alone}) == 4, "the seeds make no difference"
    assert multiprocessing.active_children() == []


def test_a_dead_worker_is_replaced_and_its_run_tried_once_more(jobs, tmp_path):
    plain = jobs(5)
    flag = tmp_path / "died"
    once = f"{as_code(plain[1])} if __import__('os').path.exists({str(flag)!r}) else "
    once += f"(open({str(flag)!r}, 'w').close(), {KILL})"
    given = list(plain)
    given[1] = trap(plain[1], once)
    given[2] = trap(plain[2], KILL)
    given[3] = trap(plain[3], as_code(plain[3], folder=None))  # Path(None): a TypeError inside `do`
    done = {each.index: each.outcome for each in run_jobs(given, 2)}
    assert done == {0: "completed", 1: "completed", 2: WORKER_DIED, 3: CRASHED, 4: "completed"}
    assert flag.exists()
    assert detail(plain[2]) == {
        "name": WORKER_DIED,
        "sentence": "The process that ran it died at every try.",
        "t_s": 0.0,
        "detail": "exit code -9",
        "data": {},
    }
    crash = detail(plain[3])
    assert crash["sentence"] == "The run raised an error inside surgsim: a bug."
    assert crash["detail"].startswith("Traceback (most recent call last):\n")
    assert crash["detail"].count("  File ") == 3, "the last three calls"
    assert crash["detail"].splitlines()[-1].startswith("TypeError: ")
    assert [metrics(plain[i])[1]["name"] for i in (0, 1, 4)] == ["completed"] * 3


def test_processes_that_cannot_start_end_the_batch_and_fail_no_run(jobs, tmp_path, monkeypatch):
    monkeypatch.setattr(workers, "_SPAWN", multiprocessing.get_context("spawn"))
    before = multiprocessing.spawn.get_executable()
    multiprocessing.set_executable("/bin/false")
    try:
        with pytest.raises(SurgsimError) as error:
            list(run_jobs(jobs(2), 2))
    finally:
        multiprocessing.set_executable(before)
    assert str(error.value) == "worker processes end before they can begin (exit code 1)"
    assert not (tmp_path / "runs").exists()


def test_a_disk_that_refuses_ends_the_batch_and_a_later_call_goes_on(jobs):
    """The kernel refuses to let files grow past the limit, in the worker that takes the first job."""
    plain = jobs(3)
    limit = "__import__('resource').setrlimit(__import__('resource').RLIMIT_FSIZE, (1000, 1000))"
    with pytest.raises(SurgsimError) as error:
        list(run_jobs([trap(plain[0], f"({limit}, {as_code(plain[0])})[1]"), *plain[1:]], 1))
    text = (
        f"cannot write {plain[0].folder}: File too large; what is whole stays, --resume goes on with the rest"
    )
    assert str(error.value) == text
    assert multiprocessing.active_children() == []
    assert os.listdir(Path(plain[0].folder).parent) == []
    assert do(plain[0]) == "completed"


def test_a_failure_that_cannot_be_written_ends_the_batch_too(jobs, tmp_path):
    (plain,) = jobs(1)
    (tmp_path / "runs").write_text("a file where the folder should be")
    with pytest.raises(SurgsimError) as error:
        list(run_jobs([trap(plain, as_code(plain, folder=None))], 1))
    assert str(error.value).startswith(f"cannot write {plain.folder}: ")
    assert str(error.value).endswith("; what is whole stays, --resume goes on with the rest")


def test_workers_end_when_the_caller_stops_listening(jobs):
    running = run_jobs(jobs(3), 1)
    next(running)
    assert len(multiprocessing.active_children()) == 1
    running.close()
    assert multiprocessing.active_children() == []


def test_nothing_to_do_starts_no_process():
    assert list(run_jobs([], 4)) == []
