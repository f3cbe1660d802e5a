"""Ratios of ticks held against those that are kept in a file."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from surgsim.errors import SurgsimError
from surgsim.recording.files import write_file

Row = dict[str, Any]

GROWN = 1.25
"""Grown by so much, a ratio is a regression: two measurements of the same code differ by less."""


def read_kept(file: Path) -> dict[str, float]:
    """The ratios in `file`, by the name of the case.

    Raises:
        SurgsimError: If it cannot be read, or is not such a file.
    """
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        return {str(name): float(ratio) for name, ratio in content["ratios"].items()}
    except OSError as error:
        raise SurgsimError(f"{file}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise SurgsimError(f"{file}: holds no ratios as `surgsim bench --keep` writes them") from error


def keep(file: Path, rows: Sequence[Row], machine: Mapping[str, Any]) -> None:
    """Write the rows' ratios; those of other cases that the file holds stay.

    Raises:
        SurgsimError: If it holds something else, or cannot be written.
    """
    ratios = read_kept(file) if file.exists() else {}
    ratios |= {row["case"]: round(row["ratio"], 2) for row in rows}
    content = {"machine": dict(machine), "ratios": dict(sorted(ratios.items()))}
    try:
        write_file(file, json.dumps(content, indent=2) + "\n")
    except OSError as error:
        raise SurgsimError(f"{file}: {error.strerror or error}") from error


def against(rows: Sequence[Row], kept: Mapping[str, float]) -> list[Row]:
    """The rows with `kept`, None for a case that is new, and whether the ratio has `grown`."""
    found = []
    for row in rows:
        before = kept.get(row["case"])
        grown = before is not None and row["ratio"] > GROWN * before
        found.append({**row, "kept": before, "grown": grown})
    return found
