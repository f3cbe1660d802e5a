"""`surgsim.compare`."""

import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from surgsim.api.comparison import Comparison
from surgsim.api.suites import suite_of
from surgsim.cli.output import show_batch_progress
from surgsim.compare.choice import runner_of, workers_for
from surgsim.compare.engine import Batch
from surgsim.compare.engine import compare as run_batch
from surgsim.compare.suite import with_changes
from surgsim.control.controller import ControllerConfig
from surgsim.errors import SurgsimError
from surgsim.scenario.arms import Experiment
from surgsim.scenario.externals import externals_given
from surgsim.scenario.load import Source
from surgsim.scenario.plain import assignments_of

Name = str | os.PathLike[str]
Controllers = Source | ControllerConfig | Sequence[Source | ControllerConfig]


def compare(
    what: Source | Experiment | Sequence[Source | Experiment],
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
    externals: Mapping[str, str] | None = None,
    **blocks: Any,
) -> Comparison:
    """Run a suite, or scenarios with several controllers and seeds, and compare them.

    Args:
        what: A suite, by name or path; or one scenario or several, each a name, a path, a mapping or a
            `Scenario`.
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
        externals: Commands of controllers outside surgsim by name, as `--external` of the command.
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
    suite = with_changes(suite, None, _seeds(seeds), record, assignments_of(blocks, settings), matters)
    runner, count = runner_of(engine, address), workers_for(jobs)
    given = externals_given(externals or {})
    with given, _target(out) as target, _shown(suite.name, progress) as report:
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


def _shown(name: str, progress: bool) -> AbstractContextManager[Callable[[int, int, str], None] | None]:
    """The command's progress, or none."""
    return show_batch_progress(name) if progress else nullcontext()
