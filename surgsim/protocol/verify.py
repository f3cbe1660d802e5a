"""A bundle verified: what it says is checked, then a part of its runs, or all, are done again."""

import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from surgsim.compare.workers import run_jobs
from surgsim.errors import SurgsimError
from surgsim.metrics.catalog import METRICS
from surgsim.protocol.bundle import Bundle
from surgsim.protocol.checks import (
    Asked,
    asked_of,
    check_files,
    check_keys,
    check_protocol,
    check_rows,
    check_scorecard,
)
from surgsim.protocol.definition import Protocol
from surgsim.protocol.findings import Finding
from surgsim.protocol.installation import check_code, platform_differences
from surgsim.protocol.rows import Row, row_of
from surgsim.protocol.runs import Report, Runner, Store, run_cells

FRACTION = 0.05
TOLERANCE = 0.01
"""How far numbers of another platform may be off: in what matters of the metric, or of the number itself."""
Rows = Mapping[str, Row]


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much is done again, and how.

    Attributes:
        fraction: Share of the runs that are done again; at least one, all for 1.
        sample: Seed of the choice of runs: a forger must not know it.
        tolerance: Of another platform's numbers; see `close`.
        jobs: Worker processes.
        runner: What does the runs.
    """

    fraction: float = FRACTION
    sample: int
    tolerance: float = TOLERANCE
    jobs: int = 1
    runner: Runner = run_jobs


@dataclass(frozen=True, kw_only=True)
class Verification:
    """What came of a bundle.

    Attributes:
        findings: Every difference that there may not be.
        platform: What of the platform is different; numbers may then differ within the tolerance.
        total: Runs of the bundle.
        again: Cells that were run again; none where something was found before.
        exact: Of those, how many gave the same to the last bit.
        effort: How much was to be done.
    """

    findings: tuple[Finding, ...]
    platform: tuple[Finding, ...]
    total: int
    again: tuple[str, ...] = field(default=())
    exact: int = 0
    effort: Effort

    @property
    def verified(self) -> bool:
        """Whether the bundle is what it says."""
        return not self.findings


def check(bundle: Bundle, protocol: Protocol) -> tuple[list[Finding], Asked | None]:
    """All that can be checked without a run.

    Returns:
        What was found, and what the protocol asks for; None where that cannot be told.
    """
    found = [*check_files(bundle), *check_protocol(bundle, protocol)]
    if any(each.where in ("protocol", "track", "arms", "seeds") for each in found):
        return found, None
    asked = asked_of(bundle, protocol)
    if isinstance(asked, Finding):
        return [*found, asked], None
    rows = list(check_rows(bundle, asked, protocol))
    found += [*rows, *check_keys(bundle), *check_code(bundle, asked)]
    if not any(each.what.startswith("metric ") for each in rows):
        found += check_scorecard(bundle, protocol, bundle.rows)
    return found, asked


def verify(bundle: Bundle, protocol: Protocol, effort: Effort, report: Report | None = None) -> Verification:
    """Check a bundle, and where nothing is wrong with what it says, do a sample of its runs again.

    Runs are done in a store of their own that is thrown away: nothing of the bundle's maker, and nothing that
    was run here before, is taken for them.

    Raises:
        SurgsimError: If the disk refuses, or processes cannot start.
    """
    found, asked = check(bundle, protocol)
    other = tuple(platform_differences(bundle))
    if found or asked is None:
        return Verification(findings=tuple(found), platform=other, total=len(bundle.rows), effort=effort)
    told = {row.cell: row for row in bundle.rows}
    again = _run(sample(sorted(told), effort.fraction, effort.sample), asked, protocol, effort, report)
    tolerance = effort.tolerance if other else 0.0
    return Verification(
        findings=tuple(one for cell, row in again.items() for one in compared(told[cell], row, tolerance)),
        platform=other,
        total=len(bundle.rows),
        again=tuple(again),
        exact=sum(not list(compared(told[cell], row, 0.0)) for cell, row in again.items()),
        effort=effort,
    )


def sample(cells: Sequence[str], fraction: float, seed: int) -> list[str]:
    """At least one of the cells, without repetition; the same for the same seed.

    Raises:
        SurgsimError: If the fraction is not above 0 and at most 1.
    """
    check_fraction(fraction)
    count = max(1, math.ceil(fraction * len(cells) - 1e-9)) if cells else 0
    places = np.random.default_rng(seed).choice(len(cells), count, replace=False) if count else ()
    return [cells[place] for place in sorted(places)]


def check_fraction(fraction: float) -> None:
    """Refuse a share that is none.

    Raises:
        SurgsimError: If it is not above 0 and at most 1.
    """
    if not 0.0 < fraction <= 1.0:
        raise SurgsimError(f"--fraction: {fraction:g} is not allowed: must be above 0, and at most 1")


def escape(total: int, again: int, altered: int) -> float:
    """Probability that none of `altered` runs is among `again` of `total` that are run again.

    C(total - altered, again) / C(total, again), the hypergeometric distribution's at 0.

    Example:
        >>> round(escape(240, 12, 24), 3)
        0.274
    """
    return math.comb(total - altered, again) / math.comb(total, again)


def close(a: float, b: float, metric: str, tolerance: float) -> bool:
    """Whether two numbers differ by at most `tolerance` of the larger one, or of what matters."""
    return abs(a - b) <= tolerance * max(abs(a), abs(b), METRICS[metric].matters)


def compared(told: Row, found: Row, tolerance: float) -> Iterator[Finding]:
    """What a run gives here against what the bundle says of it: how it ended, then every metric."""
    where = f"cell {told.cell}"
    for name in ("outcome", "success", "exceeded"):
        there, here = getattr(told, name), getattr(found, name)
        if there != here:
            yield Finding(where=where, what=name, bundle=_words(there), here=_words(here))
    for name in sorted(told.metrics):
        a, b = told.metrics[name], found.metrics.get(name)
        if a != b and (a is None or b is None or not close(a, b, name, tolerance)):
            yield Finding(where=where, what=name, bundle=_words(a), here=_words(b))


def _words(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(value) or "nothing"
    return "none" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def _run(
    chosen: Sequence[str], asked: Asked, protocol: Protocol, effort: Effort, report: Report | None
) -> dict[str, Row]:
    with tempfile.TemporaryDirectory(prefix="surgsim-verify-") as folder:
        store = Store(folder=Path(folder) / "store")
        runs = run_cells([asked.cells[cell] for cell in chosen], store, effort.runner, effort.jobs, report)
        assert runs is not None  # there are no shards
        return {each.cell.id: row_of(each, protocol.config) for each in runs}
