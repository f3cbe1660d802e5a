"""What a score keeps of a run: a row, without anything that depends on time or machine."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from surgsim.compare.job import REFUSED
from surgsim.compare.observations import COMPLETED
from surgsim.errors import SurgsimError, UnreachableError
from surgsim.protocol.canonical import canonical
from surgsim.protocol.cells import BASE, Cell, reference
from surgsim.protocol.definition import ProtocolConfig
from surgsim.protocol.runs import Found, Summary, run_key
from surgsim.runs.folder import execute, summary_of, summary_of_result
from surgsim.scenario.schema import Scenario
from surgsim.simulate.setup import prepare
from surgsim.verdict import unfinished

UNREACHABLE = "unreachable"
"""Outcome of a drawn scenario that no controller can begin: it counts for nobody."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """A run of a score.

    Attributes:
        cell: The cell's id.
        generator: The generator of its scenario.
        arm: The robot.
        axis: The quantity that is changed; `base` where none is.
        level: Its level; None where none is.
        seed: The seed.
        scenario_sha256: Hash of the scenario; None where the controller does not fit it.
        run_key: Key of the run; None where it does not fit.
        outcome: Name of the outcome; `unreachable` where no controller could begin.
        success: Whether the task was done.
        exceeded: Metrics past their thresholds.
        metrics: The protocol's metrics.
    """

    cell: str
    generator: str
    arm: str
    axis: str
    level: float | None
    seed: int
    scenario_sha256: str | None
    run_key: str | None
    outcome: str
    success: bool | None
    exceeded: tuple[str, ...]
    metrics: Mapping[str, float | None]

    @property
    def counts(self) -> bool:
        """Whether the run says anything of the controller."""
        return self.outcome != UNREACHABLE

    @property
    def completed(self) -> bool:
        """Whether it ran to its end."""
        return self.outcome == COMPLETED

    @property
    def failed(self) -> bool:
        """Whether it ended early, its task was not done, or a threshold was passed."""
        return not self.completed or self.success is False or bool(self.exceeded)


def row_of(found: Found, protocol: ProtocolConfig) -> Row:
    """The row of a cell's run."""
    cell, summary = found.cell, found.summary
    if cell.scenario is None or summary is None:
        return _row(cell, None, None, REFUSED, {}, protocol)
    outcome = str(summary["outcome"]["name"])
    if outcome == REFUSED and not reachable(cell.scenario):
        outcome = UNREACHABLE
    return _row(cell, cell.scenario.sha256(), found.key, outcome, summary, protocol)


def run_cell(cell: Cell, protocol: ProtocolConfig) -> Row:
    """Run a cell here and now, in no store, and give its row."""
    if cell.scenario is None:
        return row_of(Found(cell=cell, key="", summary=None), protocol)
    try:
        summary = summary_of_result(cell.scenario, execute(cell.scenario))
    except SurgsimError as error:
        outcome = {"name": REFUSED, "detail": str(error)}
        summary = summary_of(cell.scenario, outcome, unfinished(REFUSED), {}, 0.0)
    return row_of(Found(cell=cell, key=run_key(cell.scenario), summary=summary), protocol)


def _row(
    cell: Cell,
    scenario_sha256: str | None,
    key: str | None,
    outcome: str,
    summary: Summary,
    protocol: ProtocolConfig,
) -> Row:
    values = summary.get("metrics", {})
    past = [held["metric"] for held in summary.get("thresholds", ()) if held["exceeded"]]
    return Row(
        cell=cell.id,
        generator=cell.generator,
        arm=cell.arm,
        axis=cell.axis or BASE,
        level=cell.level,
        seed=cell.seed,
        scenario_sha256=scenario_sha256,
        run_key=key,
        outcome=outcome,
        success=summary.get("success", False),
        exceeded=tuple(past),
        metrics={name: values.get(name) for name in protocol.metrics},
    )


def reachable(scenario: Scenario) -> bool:
    """Whether a controller can begin at all, whichever it is."""
    try:
        prepare(scenario.model_copy(update={"controller": reference()}))
    except UnreachableError:
        return False
    except SurgsimError:
        return True
    return True


def rows_text(rows: Sequence[Row]) -> str:
    """The content of `rows.jsonl`: a canonical line for each row, sorted by cell."""
    return "".join(canonical(asdict(row)) + "\n" for row in sorted(rows, key=lambda row: row.cell))


def rows_sha256(text: str) -> str:
    """Hash of the content of `rows.jsonl`."""
    return hashlib.sha256(text.encode()).hexdigest()


def read_rows(path: Path) -> list[Row]:
    """The rows of a score's folder.

    Raises:
        SurgsimError: If the file cannot be read, or holds something else.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        return [_read(json.loads(line)) for line in lines]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SurgsimError(f"{path}: cannot be read as rows of a score: {error}") from error


def _read(content: dict[str, Any]) -> Row:
    return Row(**{**content, "exceeded": tuple(content["exceeded"])})
