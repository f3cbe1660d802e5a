"""One controller through a protocol: its runs, its rows, its scorecard, in a folder."""

import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from surgsim.compare.job import BROKEN
from surgsim.compare.workers import run_jobs
from surgsim.errors import SurgsimError
from surgsim.metrics.timing import TIMING_METRICS
from surgsim.protocol.canonical import sha256_of
from surgsim.protocol.cells import cells
from surgsim.protocol.definition import Protocol
from surgsim.protocol.entrants import Entrant, check_entry
from surgsim.protocol.freeze import check_frozen
from surgsim.protocol.rows import Row, row_of, rows_sha256, rows_text
from surgsim.protocol.runs import Found, Report, Runner, Store, run_cells
from surgsim.protocol.scorecard import scorecard
from surgsim.protocol.seeds import Seeds
from surgsim.recording.files import replacing, write_file
from surgsim.recording.folders import make_folder
from surgsim.runs.part_origins import check_parts
from surgsim.runs.provenance import provenance

SCHEMA_VERSION = 1
SCORE, ROWS, TIMING = "score.json", "rows.jsonl", "timing.json"
PASSPORT = ("passport.html", "passport.pdf", "passport.png")
FILES = frozenset({SCORE, ROWS, TIMING, *PASSPORT})


@dataclass(frozen=True, kw_only=True)
class Wish:
    """What is to be scored.

    Attributes:
        protocol: The protocol.
        track: Name of the track.
        arms: Robots, in the protocol's order.
        seeds: Where seeds come from.
        entrant: The controller.
    """

    protocol: Protocol
    track: str
    arms: tuple[str, ...]
    seeds: Seeds
    entrant: Entrant


@dataclass(frozen=True, kw_only=True)
class Means:
    """How runs are done.

    Attributes:
        store: Finished runs.
        jobs: Worker processes.
        runner: What does the runs.
        shard: This part of the runs, `(i, n)` with 1 <= i <= n.
        command: The command line, for the record.
    """

    store: Store
    jobs: int = 1
    runner: Runner = run_jobs
    shard: tuple[int, int] = (1, 1)
    command: str = ""


@dataclass(frozen=True, kw_only=True)
class Score:
    """A finished score.

    Attributes:
        content: Content of `score.json`.
        rows: Its rows.
        timing: Content of `timing.json`.
    """

    content: Mapping[str, Any]
    rows: tuple[Row, ...]
    timing: Mapping[str, Any]

    @property
    def scorecard(self) -> Mapping[str, Any]:
        """The scorecard."""
        card: Mapping[str, Any] = self.content["scorecard"]
        return card

    @property
    def name(self) -> str:
        """What the controller is called."""
        return str(self.content["controller"]["name"])

    @property
    def broken(self) -> list[str]:
        """Cells that a fault of surgsim or of the machine ended."""
        return [row.cell for row in self.rows if row.outcome in BROKEN]


def score(wish: Wish, means: Means, report: Report | None = None) -> Score | None:
    """Do what is missing of a controller's runs, and make its score of them.

    Returns:
        The score; None while runs of other shards are missing.

    Raises:
        SurgsimError: If the protocol changed, the controller may not enter, or runs cannot be done.
    """
    check_entry(wish.track, wish.protocol.track(wish.track), wish.entrant.config)
    frozen = check_frozen(wish.protocol, wish.track, wish.arms)
    asked = cells(wish.protocol, wish.track, wish.arms, wish.seeds, wish.entrant.config, wish.entrant.scheme)
    check_parts([cell.scenario for cell in asked if cell.scenario is not None])
    found = run_cells(asked, means.store, means.runner, means.jobs, report, means.shard)
    return None if found is None else score_of(wish, found, frozen, means.command)


def score_of(wish: Wish, found: Sequence[Found], protocol_sha256: str, command: str = "") -> Score:
    """The score of finished runs."""
    rows = tuple(sorted((row_of(each, wish.protocol.config) for each in found), key=lambda row: row.cell))
    card = scorecard(
        rows,
        wish.protocol,
        protocol_sha256=protocol_sha256,
        track=wish.track,
        arms=wish.arms,
        seeds=wish.seeds.told(),
        definition_sha256=wish.entrant.definition_sha256,
        tuning=wish.entrant.tuning,
    )
    content = {
        "schema_version": SCHEMA_VERSION,
        "protocol": wish.protocol.name,
        "protocol_sha256": protocol_sha256,
        "draft": wish.protocol.config.draft,
        "track": wish.track,
        "arms": list(wish.arms),
        "seeds": wish.seeds.told(),
        "controller": _controller(wish.entrant, found),
        "tuning": dict(wish.entrant.tuning),
        "environment": {**provenance(), "processor": platform.processor() or platform.machine()},
        "rows_sha256": rows_sha256(rows_text(rows)),
        "scorecard": card,
        "scorecard_sha256": sha256_of(card),
    }
    return Score(content=content, rows=rows, timing=_timing(found, command))


def _controller(entrant: Entrant, found: Sequence[Found]) -> dict[str, Any]:
    """The controller: all of it, and hashes of the code that is not ours."""
    told: dict[str, dict[str, Any]] = {"plugins": {}, "policies": {}, "externals": {}}
    for each in found:
        for kind in told:
            told[kind].update({} if each.summary is None else each.summary["provenance"][kind])
    return {
        "name": entrant.name,
        "definition": entrant.definition,
        "definition_sha256": entrant.definition_sha256,
        **told,
        "weights": dict(entrant.weights),
    }


def _timing(found: Sequence[Found], command: str) -> dict[str, Any]:
    """What depends on the machine, over runs that have it."""
    summaries = {each.key: each.summary for each in found if each.summary is not None}
    wall = [summary["provenance"]["wall_time_s"] for summary in summaries.values()]
    told: dict[str, Any] = {"command": command, "runs": len(summaries), "wall_time_s": round(sum(wall), 3)}
    for name in sorted(TIMING_METRICS):
        values = [summary["metrics"].get(name) for summary in summaries.values()]
        known = np.array([value for value in values if value is not None])
        told[name] = {"mean": float(known.mean()), "worst": float(known.max())} if known.size else None
    return told


def check_out(folder: Path, *, resume: bool) -> None:
    """Refuse a folder that holds something else, or a score that was not asked to be made again.

    Raises:
        SurgsimError: If it does.
    """
    if folder.exists() and not folder.is_dir():
        raise SurgsimError(f"{folder} is a file; --out names a folder")
    names = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    if foreign := {name for name in names - FILES if not name.endswith(".partial")}:
        raise SurgsimError(f"{folder} holds '{min(foreign)}', which is not a score's; choose another --out")
    if SCORE in names and not resume:
        raise SurgsimError(f"{folder} holds a score; give --resume to make it again, or another --out")


def write_score(folder: Path, score: Score) -> None:
    """Write `rows.jsonl`, `timing.json` and, last, `score.json`; each whole or not at all.

    Raises:
        SurgsimError: If the disk refuses.
    """
    try:
        make_folder(folder)
        for name, text in (
            (ROWS, rows_text(score.rows)),
            (TIMING, json.dumps(score.timing, indent=2) + "\n"),
            (SCORE, json.dumps(score.content, indent=2) + "\n"),
        ):
            with replacing(folder / name) as draft:
                write_file(draft, text)
    except OSError as error:
        raise SurgsimError(f"cannot write {folder}: {error.strerror or error}") from error
