"""Whether a batch has its table."""

from pathlib import Path

from surgsim.display import count

CSV, SEAL = "runs.csv", "runs.csv.sha256"
"""The table, and its checksum as `sha256sum` writes it: with that the batch is finished."""


def has_table(root: Path) -> bool:
    """Whether `root` holds the table of a finished batch."""
    return (root / SEAL).is_file()


def unfinished(root: Path) -> str:
    """What is there of a batch without a table, in words; empty if `root` holds a table or no batch.

    A run counts once its folder has its name: a draft, which is hidden, is none.
    """
    if not (root / "suite.json").is_file() or has_table(root):
        return ""
    there = len(list(root.glob("runs/*/*/[!.]*/metrics.json")))
    return f"the batch is not finished: {count(there, 'run')} there, no table yet"
