"""A bundle: all that a stranger needs to check a score, in one archive.

| file | content |
|---|---|
| `bundle.json` | `bundle` (surgsim), `schema_version`, and for each other file its `sha256` and `bytes` |
| `score.json` | as in the score's folder: scorecard, controller, seeds, environment |
| `rows.jsonl` | as there: a run a line |
| `timing.json` | as there: what depends on the machine |
| `code.json` | hash of each source file and asset (`files`), versions of the `compilers`, name of the `cpu` |

Weights and packages are not in it, their hashes are. What a person looks at is made again from the rows.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from surgsim.errors import SurgsimError
from surgsim.protocol.archive import unpack
from surgsim.protocol.canonical import canonical
from surgsim.protocol.rows import Row
from surgsim.protocol.runs import compilers, cpu
from surgsim.protocol.score import ROWS, SCORE, TIMING
from surgsim.protocol.strict import strict_json
from surgsim.runs.sources import source_hashes

SCHEMA_VERSION = 1
BUNDLE, CODE = "bundle.json", "code.json"
FILES = frozenset({BUNDLE, SCORE, ROWS, TIMING, CODE})
_MOST_ROWS = 100_000
Kind = TypeVar("Kind", bound=BaseModel)


class _Part(BaseModel):
    model_config = ConfigDict(strict=True, frozen=True, extra="forbid")


class FileTold(_Part):
    """What `bundle.json` says of a file."""

    sha256: str
    bytes: int


class Told(_Part):
    """Content of `bundle.json`."""

    bundle: Literal["surgsim"]
    schema_version: int
    files: dict[str, FileTold]


class Code(_Part):
    """Content of `code.json`."""

    files: dict[str, str]
    compilers: dict[str, str]
    cpu: str


class SeedsTold(_Part):
    """Where the seeds come from."""

    kind: Literal["development", "round"]
    round: str
    key: str


class ControllerTold(_Part):
    """The controller, and hashes of what it consists of beside surgsim."""

    name: str
    definition: dict[str, Any]
    definition_sha256: str
    plugins: dict[str, dict[str, Any]]
    policies: dict[str, str | None]
    externals: dict[str, dict[str, str] | None]
    weights: dict[str, str]


class Environment(_Part):
    """What the score was made with."""

    surgsim: str
    python: str
    packages: dict[str, str]
    machine: str
    processor: str
    sources_sha256: str
    commit: str | None


class ScoreTold(_Part):
    """Content of `score.json`."""

    schema_version: int
    protocol: str
    protocol_sha256: str
    draft: bool
    track: str
    arms: list[str]
    seeds: SeedsTold
    controller: ControllerTold
    tuning: dict[str, Any]
    environment: Environment
    rows_sha256: str
    scorecard: dict[str, Any]
    scorecard_sha256: str


class RowTold(_Part):
    """A line of `rows.jsonl`."""

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
    exceeded: list[str]
    metrics: dict[str, float | None]

    def row(self) -> Row:
        """The same as a row of a score."""
        return Row(**{**self.model_dump(), "exceeded": tuple(self.exceeded)})


@dataclass(frozen=True, kw_only=True)
class Bundle:
    """A bundle that was read: of the right form, with nothing checked that it says.

    Attributes:
        files: Contents of its files.
        told: What it says of them.
        score: The score.
        rows: The runs, in the file's order.
        code: The code.
    """

    files: Mapping[str, bytes]
    told: Told
    score: ScoreTold
    rows: tuple[Row, ...]
    code: Code


def files_of(folder: Path) -> dict[str, bytes]:
    """Files of the bundle of a score's folder, by name.

    Raises:
        SurgsimError: If one cannot be read.
    """
    try:
        files = {name: (folder / name).read_bytes() for name in (SCORE, ROWS, TIMING)}
    except OSError as error:
        raise SurgsimError(f"{folder}: no folder of a score: {error.strerror}: {error.filename}") from error
    code = {"files": source_hashes(), "compilers": compilers(), "cpu": cpu()}
    return with_told({**files, CODE: (canonical(code) + "\n").encode()})


def with_told(files: Mapping[str, bytes]) -> dict[str, bytes]:
    """`files` with the `bundle.json` that is theirs."""
    about = {
        name: {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
        for name, content in files.items()
        if name != BUNDLE
    }
    told = {"bundle": "surgsim", "schema_version": SCHEMA_VERSION, "files": about}
    return {**files, BUNDLE: (canonical(told) + "\n").encode()}


def read_bundle(path: Path) -> Bundle:
    """Read a bundle; nothing of it is run, imported, or written to the disk.

    Raises:
        SurgsimError: If it is none.
    """
    return bundle_of(unpack(path, FILES), str(path))


def bundle_of(files: Mapping[str, bytes], name: str) -> Bundle:
    """A bundle of the contents of its files.

    Args:
        files: Contents by name.
        name: What messages call it.

    Raises:
        SurgsimError: If it is none.
    """
    told = _checked(Told, files[BUNDLE], f"{name}: {BUNDLE}")
    if told.schema_version != SCHEMA_VERSION:
        raise SurgsimError(
            f"{name}: its schema_version is {told.schema_version}; this release reads {SCHEMA_VERSION}"
        )
    lines = files[ROWS].split(b"\n")
    if len(lines) > _MOST_ROWS:
        raise SurgsimError(f"{name}: {ROWS}: more than {_MOST_ROWS} lines")
    if lines.pop():
        raise SurgsimError(f"{name}: {ROWS}: its last line has no end")
    rows = [_row(line, f"{name}: {ROWS} line {number}") for number, line in enumerate(lines, start=1)]
    strict_json(files[TIMING], f"{name}: {TIMING}")
    return Bundle(
        files=files,
        told=told,
        score=_checked(ScoreTold, files[SCORE], f"{name}: {SCORE}"),
        rows=tuple(rows),
        code=_checked(Code, files[CODE], f"{name}: {CODE}"),
    )


def _row(line: bytes, name: str) -> Row:
    """A row of its line, which is written in the one way that there is."""
    row = _checked(RowTold, line, name).row()
    if canonical(strict_json(line, name)).encode() != line:
        raise SurgsimError(f"{name}: it is not written as `surgsim score` writes it")
    return row


def _checked(kind: type[Kind], content: bytes, name: str) -> Kind:
    """`content` as `kind`; a key that is missing, unknown or of another type is refused."""
    try:
        return kind.model_validate(strict_json(content, name))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(place) for place in first["loc"])
        raise SurgsimError(f"{name}: {where[:80]}: {first['msg']}") from error
