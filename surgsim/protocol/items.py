"""What a protocol's name stands for, a hash for each part of it."""

import ast
import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from surgsim.errors import ScenarioError, SurgsimError
from surgsim.metrics.catalog import SHIPPED
from surgsim.protocol.canonical import sha256_of
from surgsim.protocol.cells import cells_of, reference
from surgsim.protocol.definition import Protocol, ProtocolConfig, entry_file
from surgsim.protocol.seeds import Seeds
from surgsim.resources import resource_dir
from surgsim.runs.sources import ROOT, hash_of
from surgsim.scenario.hashed import hashed
from surgsim.scenario.load import load_controller

PROBE = "0" * 64
"""Key of the seeds with which scenarios are made that stand for all of a generator."""
DRAWS = 12
"""Seeds of a drawn generator that stand for all: every kind of path is among them."""
_CODE = (
    "verdict.py",
    "tasks/success.py",
    "tasks/teleoperation_program.py",
    "teleop/judgement.py",
    "scenario/thresholds.py",
)
_SCORE = ("canonical.py", "cells.py", "figures.py", "levels.py", "rows.py", "scorecard.py", "seeds.py")
_METRICS_PACKAGE = "surgsim.metrics"
_CATALOG = "metrics/catalog.py"
Items = dict[str, str]


def all_items(protocol: Protocol) -> Items:
    """Hashes of everything, by name: definition, scenarios, assets, metrics, score, entries.

    Raises:
        SurgsimError: If the protocol makes a scenario that is not valid, or names a controller that is not.
    """
    config = protocol.config
    found = items_of(protocol, list(config.generators), list(config.arms))
    for title, track in config.tracks.items():
        for scheme in track.schemes:
            found[f"scheme/{title}/{scheme}"] = _scheme(protocol, title, scheme)
        for name in track.entries:
            found.setdefault(f"entry/{name}", sha256_of(hashed(load_controller(entry_file(name)))))
    return dict(sorted(found.items()))


def items_of(protocol: Protocol, generators: Sequence[str], arms: Sequence[str]) -> Items:
    """Hashes of what a score of these generators and arms follows from."""
    told = hashed(protocol.config)
    found = {
        f"definition/{key}": sha256_of(value)
        for key, value in told.items()
        if key not in ("draft", "generators")
    }
    for generator in generators:
        config = protocol.config.generators[generator]
        found[f"definition/generators/{generator}"] = sha256_of(hashed(config))
        for arm in arms:
            found[f"scenario/{generator}/{arm}"] = _scenarios(protocol, generator, arm)
    found.update(_assets(arms))
    found.update(_code(protocol.config))
    return found


def protocol_sha256(items: Items) -> str:
    """One hash of all of a protocol's items."""
    return sha256_of(items)


def _scenarios(protocol: Protocol, generator: str, arm: str) -> str:
    """Hash of complete scenarios, every default in them, at every level: for seeds that stand for all."""
    seeds, most = Seeds(kind="probe", key=PROBE), DRAWS if protocol.config.generators[generator].drawn else 1
    hashes: dict[str, Any] = {}
    try:
        for cell in cells_of(protocol, generator, arm, seeds, reference(), most_seeds=most):
            if cell.scenario is not None:
                hashes[cell.id] = cell.scenario.sha256()
    except ScenarioError as error:
        raise SurgsimError(f"{protocol.path}: generator {generator}, arm {arm}: {error}") from error
    return sha256_of(hashes)


def _scheme(protocol: Protocol, track: str, scheme: str) -> str:
    """Hash of complete scenarios of a track's scheme."""
    seeds, settings = Seeds(kind="probe", key=PROBE), protocol.settings_of(track, scheme)
    hashes = [
        cell.scenario.sha256()
        for generator in protocol.track(track).generators
        for arm in protocol.config.arms
        for cell in cells_of(protocol, generator, arm, seeds, reference(), settings, most_seeds=1)
        if cell.scenario is not None
    ]
    return sha256_of(hashes)


def _assets(arms: Sequence[str]) -> Items:
    """Hashes of the arms' folders and of what all arms share."""
    root = resource_dir("assets")
    folders = [f"robots/{arm}" for arm in arms] + ["instruments", "theatre", "trocar", "console"]
    return {f"asset/{name}": hash_of(_files(root / name)) for name in folders}


def _code(config: ProtocolConfig) -> Items:
    """Hashes of what makes the protocol's metrics of a trace, and a scorecard of them."""
    names = {*config.metrics, *(name for name, most in config.thresholds if most is not None)}
    modules = {SHIPPED[name].__name__ for name in names}
    paths = [*(ROOT / name for name in _CODE), *sorted(_with_imports(modules))]
    found = {f"metric/{path.relative_to(ROOT).as_posix()}": _file(path) for path in paths}
    found[f"metric/{_CATALOG}"] = _functions(ROOT / _CATALOG)
    here = Path(__file__).parent
    return {**found, **{f"score/{name}": _file(here / name) for name in _SCORE}}


def _functions(path: Path) -> str:
    """Hash of a module's functions and classes: a list in it may grow."""
    text = path.read_text(encoding="utf-8")
    kinds = (ast.FunctionDef, ast.ClassDef)
    parts = [ast.get_source_segment(text, node) for node in ast.parse(text).body if isinstance(node, kinds)]
    return sha256_of(parts)


def _with_imports(modules: Iterable[str]) -> set[Path]:
    """Files of modules of metrics, and of those in the same folder that they import."""
    found: set[Path] = set()
    waiting = [_metric_file(module) for module in modules]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            tree = ast.parse(path.read_text(encoding="utf-8"))
            waiting += [_metric_file(name) for node in ast.walk(tree) for name in _imported(node)]
    return found


def _imported(node: ast.AST) -> Iterable[str]:
    """Modules of metrics that a statement imports."""
    if isinstance(node, ast.Import):
        names = [alias.name for alias in node.names]
    elif isinstance(node, ast.ImportFrom) and node.module == _METRICS_PACKAGE:
        names = [f"{_METRICS_PACKAGE}.{alias.name}" for alias in node.names]
    else:
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
    return [name for name in names if name.startswith(f"{_METRICS_PACKAGE}.")]


def _metric_file(module: str) -> Path:
    return ROOT / "metrics" / f"{module.removeprefix(f'{_METRICS_PACKAGE}.')}.py"


def _file(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _files(folder: Path) -> Iterable[tuple[str, Path]]:
    for path in folder.rglob("*"):
        if path.is_file() and "__pycache__" not in path.parts:
            yield path.relative_to(folder).as_posix(), path
