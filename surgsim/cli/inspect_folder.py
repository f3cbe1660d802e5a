"""What a folder holds, for `surgsim inspect`: a batch, runs, or a run without recording."""

import json
import shlex
from pathlib import Path

_MOST_NAMED = 5


def check_recorded(path: Path) -> None:
    """Refuse a folder that is a run without recording, or that holds runs or batches, and say what it is.

    Raises:
        SurgsimError: If it is one, with what to do.
    """
    from surgsim.errors import SurgsimError

    if not path.is_dir() or (path / "recording.rrd").exists():
        return
    if (path / "metrics.json").is_file():
        again = f"surgsim run {shlex.quote(str(path / 'scenario.yaml'))} --out DIR"
        raise SurgsimError(
            f"{path}: a run without recording{_ending(path)}; its metrics are in metrics.json. "
            f"To record it: {again}"
        )
    for what, file in (("run", "metrics.json"), ("batch", "suite.json")):
        if found := sorted(inner.parent for inner in path.glob(f"**/{file}") if not _hidden(inner, path)):
            raise SurgsimError(f"{path}: {_told(what, found)}. To look into one: surgsim inspect {found[0]}")


def _told(what: str, found: list[Path]) -> str:
    """`a folder of 3 runs: a, b, c`."""
    names = ", ".join(str(path) for path in found[:_MOST_NAMED])
    more = f" and {len(found) - _MOST_NAMED} more" if len(found) > _MOST_NAMED else ""
    many = {"run": "runs", "batch": "batches"}[what]
    return f"a folder of {len(found)} {what if len(found) == 1 else many}: {names}{more}"


def _hidden(inner: Path, path: Path) -> bool:
    """Whether `inner` is in a draft, or in another hidden folder."""
    return any(part.startswith(".") for part in inner.relative_to(path).parts)


def _ending(path: Path) -> str:
    """How the run in `path` ended, if its summary is whole."""
    from surgsim.recording.sealed import read_sealed

    try:
        summary = read_sealed(path / "metrics.json")
        return f", {summary['scenario']} with {summary['controller']}, {summary['outcome']['name']}"
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def check_finished(path: Path) -> None:
    """Refuse the folder of a batch whose table is not there yet.

    Raises:
        SurgsimError: If it is one, with the command that goes on with it.
    """
    from surgsim.compare.unfinished import unfinished
    from surgsim.errors import SurgsimError

    if told := unfinished(path):
        raise SurgsimError(f"{path}: {told}. To go on: {_command_again(path, '--resume')}")


def _command_again(path: Path, *flags: str) -> str:
    """The command line of the batch in `path`, with `flags`."""
    from surgsim.recording.sealed import read_sealed

    try:
        words = shlex.split(str(read_sealed(path / "suite.json")["command"]))
    except (OSError, ValueError, KeyError):
        words = []
    words = words or ["surgsim", "compare", "SUITE", "--out", str(path)]
    return shlex.join([*words, *(flag for flag in flags if flag not in words)])


def run_of(path: Path, run_id: str) -> Path:
    """The folder of a run of the batch in `path`.

    Raises:
        SurgsimError: If there is no such run, or it was not recorded.
    """
    from surgsim.compare.table import read_table
    from surgsim.errors import SurgsimError, unknown_name

    table = read_table(path)
    folders = {
        str(found): str(folder) for found, folder in zip(table["run_id"], table["folder"], strict=True)
    }
    if run_id not in folders:
        known = list(folders)[:20]
        raise SurgsimError(unknown_name(run_id, f"run of {path}", known))
    folder: Path = path / folders[run_id]
    if not (folder / "recording.rrd").is_file():
        again = _command_again(path, "--resume", "--record")
        raise SurgsimError(
            f"{run_id} was not recorded. To record every run: {again}. "
            f"To record this one: surgsim run {shlex.quote(str(folder / 'scenario.yaml'))} --out DIR"
        )
    return folder


def list_batch(path: Path, as_json: bool) -> None:
    """Print the runs of the batch in `path`."""
    from surgsim.cli.table import print_prose, print_table
    from surgsim.compare.table import read_table
    from surgsim.display import number
    from surgsim.metrics.catalog import METRICS

    rows = read_table(path).rows()
    if as_json:
        print(json.dumps(rows, indent=2))
        return
    shown = ("tip_error_rms_mm", "rcm_error_rms_mm", "rcm_error_max_mm")
    table = [(row["run_id"], row["outcome"], *(number(row[name]) for name in shown)) for row in rows]
    header = ("run", "outcome", *(METRICS[name].heading for name in shown))
    print_table(f"{len(rows)} runs of {path}", header, table, right=(2, 3, 4), whole=True)
    if any(row["recording"] for row in rows):
        text = f"surgsim inspect {shlex.quote(str(path))} --run RUN opens one"
    else:
        text = f"none was recorded; to record them: {_command_again(path, '--resume', '--record')}"
    print()
    print_prose(text)
