"""What every study gives back, and how its tables are written."""

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

Cell = str | int | float | None
Row = Mapping[str, Cell]
Progress = Callable[[str], None]
"""Called with a line about what is being done."""

Verdict = Literal["holds", "does not hold", "depends", "not comparable"]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A statement that the study checked.

    Attributes:
        source: Who says so: the paper with the place in it, or `surgsim`.
        text: The statement.
        verdict: Whether it holds.
        evidence: The figures behind the verdict.
    """

    source: str
    text: str
    verdict: Verdict
    evidence: str


@dataclass(frozen=True, kw_only=True)
class StudyResult:
    """What a study found.

    Attributes:
        claims: Every claim that was checked.
        tables: Name of each table to its rows; the first one is the main table.
        files: Names of the files written, in the order in which to read them.
    """

    claims: tuple[Claim, ...]
    tables: Mapping[str, Sequence[Row]]
    files: tuple[str, ...]


class RunStudy(Protocol):
    """Runs a study, writes its files into the existing folder `out`."""

    def __call__(self, out: Path, quick: bool, progress: Progress) -> StudyResult:
        """`quick` runs a sample of the cells and draws nothing."""
        ...


def write_study(
    out: Path,
    tables: Mapping[str, Sequence[Row]],
    claims: tuple[Claim, ...],
    draw: Callable[[], tuple[str, ...]] | None,
    report: Callable[[Path, tuple[str, ...]], None],
    progress: Progress,
) -> StudyResult:
    """Write a study's tables, figures and README.md into the existing folder `out`.

    Args:
        out: The folder.
        tables: Name of each table to its rows, the main one first.
        claims: Every claim that was checked.
        draw: Draws the figures and names their files; None draws nothing.
        report: Writes the page at a path, given the figures' files.
        progress: Told of what takes time.
    """
    for name, rows in tables.items():
        write_csv(out / f"{name}.csv", rows)
    figures: tuple[str, ...] = ()
    if draw is not None:
        progress("figures")
        figures = draw()
    report(out / "README.md", figures)
    files = ("README.md", *(f"{name}.csv" for name in tables), *figures)
    return StudyResult(claims=claims, tables=tables, files=files)


def format_cell(value: Cell, digits: int = 4, column: str = "") -> str:
    """A cell as text: `digits` significant digits, two decimals for percents, a dash for None."""
    if value is None:
        return "-"
    if not isinstance(value, float):
        return str(value)
    return f"{value:.2f}" if "percent" in column else f"{value:#.{digits}g}".removesuffix(".")


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write a table with nine significant digits; None is an empty cell."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(rows[0])
        for row in rows:
            writer.writerow(["" if value is None else format_csv(value) for value in row.values()])


def format_csv(value: Cell) -> str:
    """A number with nine significant digits, anything else as it is."""
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def read_csv(path: Path) -> list[dict[str, str]]:
    """Rows of a table that `write_csv` wrote, as text."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def markdown_table(rows: Iterable[Row], digits: int = 4) -> str:
    """A table in Markdown, numbers right-aligned."""
    body = list(rows)
    names = list(body[0])
    numeric = [all(isinstance(row[name], int | float | None) for row in body) for name in names]
    lines = [
        "| " + " | ".join(name.replace("_", " ") for name in names) + " |",
        "|" + "|".join("---:" if right else "---" for right in numeric) + "|",
    ]
    lines += [
        "| " + " | ".join(format_cell(row[name], digits, name) for name in names) + " |" for row in body
    ]
    return "\n".join(lines)
