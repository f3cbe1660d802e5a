"""The sections of a measurement, and what each is given."""

import math
import os
import platform
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from surgsim.bench.cases import Case, chosen
from surgsim.errors import SurgsimError, unknown_name
from surgsim.packages import RECORDING, MissingPackageError, lacking

Row = dict[str, Any]
Report = Callable[[str], None]
"""Called with what is measured next."""

SECTIONS = ("ticks", "stages", "startup", "memory", "batch", "libraries")
SHORTEST_S, MOST_S = 3.0, 3600.0
_STARTED = "circle/vprnn"
_BATCH_RUNS, _BATCH_S = 16, 2.0


@dataclass(frozen=True, kw_only=True)
class Bench:
    """What is measured.

    Attributes:
        sections: Of `SECTIONS`.
        cases: Of ticks and stages.
        duration_s: Simulated time of a run [s].
        repeat: How often: runs of a case, processes of a start, batches.
        left_out: A line for each case or part that is not measured, for a package that is not installed.
    """

    sections: tuple[str, ...]
    cases: tuple[Case, ...]
    duration_s: float
    repeat: int
    left_out: tuple[str, ...] = ()


def bench_of(
    only: Sequence[str] | None, cases: Sequence[str] | None, duration_s: float, repeat: int
) -> Bench:
    """A checked measurement; None stands for all that can be measured here.

    Raises:
        SurgsimError: If a section or case is not known, the duration is not from 3 s to an hour, or the
            count is not positive.
        MissingPackageError: If a case that is named needs a package which is not installed.
    """
    for name in only or ():
        if name not in SECTIONS:
            raise SurgsimError(unknown_name(name, "section of bench", SECTIONS))
    if not (math.isfinite(duration_s) and SHORTEST_S <= duration_s <= MOST_S and repeat >= 1):
        raise SurgsimError(
            f"bench needs a duration of at least {SHORTEST_S:g} s and at most {MOST_S:g} s, "
            "and at least one repeat"
        )
    sections = tuple(name for name in SECTIONS if only is None or name in only)
    wanted = chosen(cases)
    measured = wanted if {"ticks", "stages"} & set(sections) else []
    lacks = {case.name: line for case in measured if (line := case.lacks())}
    left_out = [f"{name}: {line}" for name, line in lacks.items()]
    if cases is not None and left_out:
        raise MissingPackageError("; ".join(left_out))
    if "startup" in sections and (line := lacking("recordings need", *RECORDING)):
        left_out.append(f"startup, its recording: {line}")
    return Bench(
        sections=sections,
        cases=tuple(case for case in wanted if case.name not in lacks),
        duration_s=duration_s,
        repeat=repeat,
        left_out=tuple(left_out),
    )


def measure(bench: Bench, report: Report) -> Iterator[tuple[str, list[Row]]]:
    """Each section with its rows, as it is done.

    Raises:
        SurgsimError: If a run cannot be started, or ends too soon.
    """
    for section in bench.sections:
        yield section, _MEASURE[section](bench, report)


def machine() -> Row:
    """What it is measured on."""
    return {
        "cpus": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
        "platform": platform.platform(),
        "python": platform.python_version(),
    }


def _ticks(bench: Bench, report: Report) -> list[Row]:
    from surgsim.bench.ticks import measure_ticks

    return [
        measure_ticks(case, bench.duration_s, bench.repeat) for case in _told("ticks", bench.cases, report)
    ]


def _stages(bench: Bench, report: Report) -> list[Row]:
    from surgsim.bench.stages import measure_stages

    return [
        measure_stages(case, bench.duration_s)
        for case in _told("stages", [c for c in bench.cases if c.has_stages], report)
    ]


def _told(section: str, cases: Sequence[Case], report: Report) -> Iterator[Case]:
    for k, case in enumerate(cases, 1):
        report(f"{section}: {case.name} ({k} of {len(cases)})")
        yield case


def _startup(bench: Bench, report: Report) -> list[Row]:
    from surgsim.bench.startup import measure_startup

    report(f"startup: {bench.repeat + 1} processes")
    return measure_startup(_STARTED, bench.repeat)


def _memory(bench: Bench, report: Report) -> list[Row]:
    from surgsim.bench.memory import measure_memory

    report("memory: a process of 111 runs")
    return measure_memory(_STARTED)


def _batch(bench: Bench, report: Report) -> list[Row]:
    from surgsim.bench.batch import WORKERS, measure_batch

    report(f"batch: {bench.repeat * len(WORKERS)} batches of {_BATCH_RUNS} runs")
    return measure_batch(_BATCH_RUNS, _BATCH_S, bench.repeat)


def _libraries(bench: Bench, report: Report) -> list[Row]:
    from surgsim.bench.libraries.measure import measure_libraries

    report("libraries: the kinematic circle")
    return measure_libraries(bench.duration_s)


_MEASURE: dict[str, Callable[[Bench, Report], list[Row]]] = {
    "ticks": _ticks,
    "stages": _stages,
    "startup": _startup,
    "memory": _memory,
    "batch": _batch,
    "libraries": _libraries,
}
