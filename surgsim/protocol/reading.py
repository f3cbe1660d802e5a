"""Scores that were written: read back, and held against their own hashes."""

import json
from pathlib import Path

from surgsim.errors import SurgsimError
from surgsim.protocol.canonical import sha256_of
from surgsim.protocol.rows import read_rows, rows_sha256
from surgsim.protocol.score import ROWS, SCHEMA_VERSION, SCORE, TIMING, Score


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
        SurgsimError: If one is damaged.
    """
    return [read_score(path.parent) for path in sorted(folder.rglob(SCORE))]


def comparable(score: Score, others: list[Score]) -> list[Score]:
    """Those of `others` of the same protocol, track, arms and seeds, and of another controller."""
    keys = ("protocol_sha256", "track", "arms", "seeds")
    mine = [score.content[key] for key in keys]
    return [
        other
        for other in others
        if [other.content[key] for key in keys] == mine
        and other.content["controller"]["definition_sha256"]
        != score.content["controller"]["definition_sha256"]
    ]
