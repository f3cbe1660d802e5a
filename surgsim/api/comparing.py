"""`surgsim.compare`."""

import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from surgsim.api.comparison import Comparison
from surgsim.api.suites import suite_of
from surgsim.cli.output import show_batch_progress
from surgsim.compare.engine import Batch, Runner
from surgsim.compare.engine import compare as run_batch
from surgsim.compare.job import Job
from surgsim.compare.observations import metric_named
from surgsim.compare.suite import with_changes
from surgsim.compare.workers import Done, run_jobs
from surgsim.control.controller import ControllerConfig
from surgsim.errors import SurgsimError
from surgsim.scenario.load import Source
from surgsim.scenario.plain import assignments_of
from surgsim.scenario.schema import Scenario

Name = str | os.PathLike[str]
Controllers = Source | ControllerConfig | Sequence[Source | ControllerConfig]


def compare(
    what: Source | Scenario | Sequence[Source | Scenario],
    /,
    *,
    controllers: Controllers | None = None,
    seeds: str | int | Iterable[int] | None = None,
    settings: Mapping[str, Any] | None = None,
    matters: Mapping[str, float] | None = None,
    jobs: int | None = None,
    engine: str = "local",
    address: str | None = None,
    out: Name | None = None,
    resume: bool = False,
    record: bool = False,
    progress: bool = False,
    **blocks: Any,
) -> Comparison:
    """Run a suite, or scenarios with several controllers and seeds, and compare them.

    Args:
        what: A suite, by name or path; or one scenario or several: names, paths, mappings or `Scenario`s.
        controllers: Controllers instead of the suite's, or of the scenarios' own: names, paths or mappings.
        seeds: Seeds instead of the suite's: an integer, several of them, or text such as `"0:10"`.
        settings: Values by key path for every run, as `--set` of the command.
        matters: Smallest differences that matter, by metric, instead of the suite's.
        jobs: Worker processes; None: one for each core.
        engine: `local`, or `ray` for a cluster.
        address: The ray cluster's address.
        out: Results folder; None: a temporary one that lives as long as what is returned.
        resume: Whether whole results in `out` are kept and only the missing ones run.
        record: Whether every run is recorded, so that it has a trace.
        progress: Whether standard error shows how far the batch is.
        **blocks: Values by a scenario's top-level key for every run, see `surgsim.load`.

    Returns:
        The results; failed runs are rows too.

    Raises:
        SurgsimError: If the suite, a scenario or the results folder is not right, or the disk refuses.

    Example:
        >>> import surgsim
        >>> found = surgsim.compare("circle_lwr4plus", controllers=["pinv", "qp"], task={"duration_s": 2.0})
        >>> found.leaderboard("tip_error_rms_mm").metric
        'tip_error_rms_mm'
    """
    suite, folder = suite_of(what, controllers)
    suite = with_changes(
        suite, None, _seeds(seeds), record, assignments_of(blocks, settings), _known(matters)
    )
    runner, count = _runner(engine, address), _jobs(jobs)
    with _target(out) as target, _shown(suite.name, progress) as report:
        batch = Batch(
            suite=suite, folder=folder, out=target, jobs=count, resume=resume, command="surgsim.compare"
        )
        table = run_batch(batch, report, runner)
        if table is None:
            raise SurgsimError(f"{target}: a run is missing; it was removed while the batch ran")
        return Comparison(target, table, temporary=out is None)


@contextmanager
def _target(out: Name | None) -> Iterator[Path]:
    """The results folder; a temporary one is removed if the batch does not come to its end."""
    if out is not None:
        yield Path(out)
        return
    folder = Path(tempfile.mkdtemp(prefix="surgsim-"))
    try:
        yield folder
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _seeds(seeds: str | int | Iterable[int] | None) -> str | None:
    """Seeds as the command takes them."""
    if seeds is None or isinstance(seeds, str):
        return seeds
    if not isinstance(seeds, Iterable):
        return str(seeds)
    listed = list(seeds)
    if len(listed) > 1 and listed == list(range(listed[0], listed[0] + len(listed))):
        return f"{listed[0]}:{listed[-1] + 1}"  # so that --resume sees the same suite
    return ",".join(map(str, listed))


def _known(matters: Mapping[str, float] | None) -> Mapping[str, float] | None:
    """`matters`, if each is of a metric."""
    for name in matters or {}:
        metric_named(name)
    return matters


def _jobs(jobs: int | None) -> int:
    if jobs is None:
        return len(os.sched_getaffinity(0))
    if jobs < 1:
        raise SurgsimError(f"--jobs: {jobs} is not allowed: must be 1 or more")
    return jobs


def _shown(name: str, progress: bool) -> AbstractContextManager[Callable[[int, int, str], None] | None]:
    """The command's progress, or none."""
    return show_batch_progress(name) if progress else nullcontext()


def _runner(engine: str, address: str | None) -> Runner:
    """What runs the jobs."""
    if address and engine != "ray":
        raise SurgsimError("--address is for --engine ray")
    if engine == "local":
        return _run_jobs
    if engine != "ray":
        raise SurgsimError(f"--engine: '{engine}' is not allowed. Allowed: local, ray.")
    from surgsim.compare.ray_engine import ray_runner

    runner: Runner = ray_runner(address)
    return runner


def _run_jobs(jobs: Sequence[Job], count: int) -> Iterator[Done]:
    """The local workers, for a script without `if __name__ == "__main__"` too."""
    with _script_hidden():
        yield from run_jobs(jobs, count)


@contextmanager
def _script_hidden() -> Iterator[None]:
    """Keep new processes from running the user's script again: workers need nothing of it."""
    main = sys.modules["__main__"]
    hidden: dict[str, Any] = {
        name: vars(main).pop(name) for name in ("__file__", "__spec__") if name in vars(main)
    }
    main.__spec__ = None
    try:
        yield
    finally:
        vars(main).update(hidden)
