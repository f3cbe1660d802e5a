"""A batch whose table is not there yet."""

from pathlib import Path

from surgsim.display import count


def unfinished(root: Path) -> str:
    """What is there of a batch without a table, in words; empty if `root` holds a table or no batch.

    A run counts once its folder has its name: a draft, which is hidden, is none.
    """
    if not (root / "suite.json").is_file() or (root / "runs.parquet").is_file():
        return ""
    there = len(list(root.glob("runs/*/*/[!.]*/metrics.json")))
    return f"the batch is not finished: {count(there, 'run')} there, no table yet"
