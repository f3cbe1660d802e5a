"""Scores that were written: read back, and held against their own hashes."""

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from surgsim.errors import SurgsimError
from surgsim.protocol.canonical import sha256_of
from surgsim.protocol.definition import Protocol, entry_label
from surgsim.protocol.rows import read_rows, rows_sha256
from surgsim.protocol.score import ROWS, SCHEMA_VERSION, SCORE, TIMING, Score
from surgsim.protocol.scorecard import scorecard

_MOST = 6


def read_score(folder: Path) -> Score:
    """The score in `folder`.

    Raises:
        SurgsimError: If there is none, or it is not what its hashes say.
    """
    try:
        content = json.loads((folder / SCORE).read_text(encoding="utf-8"))
        if content["schema_version"] != SCHEMA_VERSION:
            raise ValueError(f"its schema_version is {content['schema_version']}, not {SCHEMA_VERSION}")
        if sha256_of(content["scorecard"]) != content["scorecard_sha256"]:
            raise ValueError("its scorecard is not that of scorecard_sha256")
        if rows_sha256((folder / ROWS).read_text(encoding="utf-8")) != content["rows_sha256"]:
            raise ValueError(f"{ROWS} is not that of rows_sha256")
        timing = json.loads((folder / TIMING).read_text(encoding="utf-8"))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SurgsimError(f"{folder} cannot be read as a score: {error}") from error
    return Score(content=content, rows=tuple(read_rows(folder / ROWS)), timing=timing)


def scores_below(folder: Path) -> list[Score]:
    """Every score in `folder` and its subfolders, by path.

    Raises:
        SurgsimError: If there is none, or one is damaged.
    """
    found = [read_score(path.parent) for path in sorted(folder.rglob(SCORE))]
    if not found:
        raise SurgsimError(f"{folder} holds no score")
    return found


def baselines_of(score: Score, others: Iterable[Score], protocol: Protocol) -> list[Score]:
    """Scores to draw beside `score`: the baselines of its track among `others`, else all of them.

    They are of the same protocol, track and seeds, of the same arms or of these and more, which are left out.
    """
    keys, arms = ("protocol_sha256", "track", "seeds"), score.content["arms"]
    mine = score.content["controller"]["definition_sha256"]
    found = [
        _of_arms(other, arms, protocol)
        for other in others
        if all(other.content[key] == score.content[key] for key in keys)
        and set(arms) <= set(other.content["arms"])
        and other.content["controller"]["definition_sha256"] != mine
    ]
    names = [entry_label(entry) for entry in protocol.config.tracks[score.content["track"]].baselines]
    return [other for other in found if other.name in names] or found[:_MOST]


def why_none_beside(score: Score, others: Iterable[Score]) -> str:
    """Why none of `others` is drawn beside `score`, in a line."""
    mine = score.content["protocol_sha256"]
    drafts = sorted({other.content["protocol_sha256"][:8] for other in others} - {mine[:8]})
    if drafts:
        name = score.content["protocol"]
        return f"no score is drawn beside it: those are of {name} {', '.join(drafts)}, this is of {mine[:8]}"
    return "no score is drawn beside it: none is of its track, seeds and arms"


def _of_arms(score: Score, arms: list[str], protocol: Protocol) -> Score:
    """`score` with the runs of these arms alone."""
    if score.content["arms"] == arms:
        return score
    rows = tuple(row for row in score.rows if row.arm in arms)
    content = score.content
    card = scorecard(
        rows,
        protocol,
        protocol_sha256=content["protocol_sha256"],
        track=content["track"],
        arms=arms,
        seeds=content["seeds"],
        definition_sha256=content["controller"]["definition_sha256"],
        tuning=content["tuning"],
    )
    return replace(score, rows=rows, content={**content, "arms": arms, "scorecard": card})
