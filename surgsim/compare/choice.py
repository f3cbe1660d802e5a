"""What a command or a call means: which suite, how many workers, what does the runs, and which of them."""

import re
from collections.abc import Container, Sequence
from pathlib import Path

from surgsim.compare.engine import Runner
from surgsim.compare.suite import SuiteConfig, ad_hoc_suite, is_suite, load_suite
from surgsim.compare.workers import run_jobs
from surgsim.errors import ScenarioError, SurgsimError, unknown_name
from surgsim.resources import cores
from surgsim.scenario.drawn import drawn_names
from surgsim.scenario.load import shipped

MOST_SHARDS = 10_000


def suite_named(names: Sequence[str], given: Container[str] = ()) -> tuple[SuiteConfig, Path]:
    """The suite of that name, or one of the scenarios named; with the folder of its relative paths.

    Args:
        names: A suite, or scenarios: shipped names or paths.
        given: Names of scenarios that have no file.

    Raises:
        SurgsimError: If a suite and scenarios are mixed, or a name is neither a suite's nor a scenario's.
    """
    first = names[0]
    if first in given:
        return ad_hoc_suite(names, None), Path()
    _check_name(first)
    if not is_suite(first):
        return ad_hoc_suite(names, None), Path()
    if len(names) > 1:
        raise SurgsimError("give one suite, or scenarios; not both")
    return load_suite(first)


def _check_name(name: str) -> None:
    """Refuse a name that is neither a shipped suite's nor a scenario's, and no path."""
    known = [*shipped("suites"), *shipped(), *drawn_names()]
    if (
        name not in known
        and not name.startswith("random_")
        and len(Path(name).parts) < 2
        and not Path(name).suffix
    ):
        text = unknown_name(name, "shipped suite or scenario", known)
        raise ScenarioError("", f"{text} Or give a .yaml file.")


def workers_for(jobs: int | None) -> int:
    """Worker processes: `jobs`, or one for each core that this process may use.

    Raises:
        SurgsimError: If there would be none.
    """
    if jobs is None:
        return cores()
    if jobs < 1:
        raise SurgsimError(f"--jobs: {jobs} is not allowed: must be 1 or more")
    return jobs


def runner_of(engine: str, address: str | None) -> Runner:
    """What does the runs: `local` processes, or the `ray` cluster at `address`.

    Raises:
        SurgsimError: If there is no such engine, an address is of no use to it, or ray cannot be used.
    """
    if engine not in ("local", "ray"):
        raise SurgsimError(f"--engine: '{engine}' is not allowed. Allowed: local, ray.")
    if engine == "local":
        if address:
            raise SurgsimError("--address is for --engine ray")
        return run_jobs
    from surgsim.compare.ray_engine import ray_runner  # ray may not be installed

    runner: Runner = ray_runner(address)
    return runner


def shard_of(text: str) -> tuple[int, int]:
    """Which share of the runs: I and N of `I/N`, counted from 1.

    Raises:
        SurgsimError: If it is none.
    """
    found = re.fullmatch(r"([0-9]{1,5})/([0-9]{1,5})", text)
    i, n = (int(found[1]), int(found[2])) if found else (0, 0)
    if not 1 <= i <= n <= MOST_SHARDS:
        raise SurgsimError(f"--shard: '{text[:60]}' is not I/N with 1 <= I <= N <= {MOST_SHARDS}")
    return i, n
