"""Finding and loading scenario and controller files."""

import json
import operator
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from surgsim.control.controller import ControllerConfig
from surgsim.errors import ScenarioError, unknown_name
from surgsim.models.config import KINDS
from surgsim.resources import resource_dir
from surgsim.scenario.drawn import drawn_document
from surgsim.scenario.plain import document_of
from surgsim.scenario.schema import Scenario
from surgsim.scenario.validate import validate
from surgsim.scenario.wording import one_line, show_with_kind
from surgsim.scenario.yaml_text import YamlDocument, read_yaml, set_value

Source = str | os.PathLike[str] | Mapping[str, Any]
"""A shipped name, a path, or the content itself."""
_GIVEN_CONTROLLER = "given controller"


def shipped(folder: str = "") -> dict[str, Path]:
    """Names and files of the shipped scenarios, or of `controllers` and the like."""
    return {path.stem: path for path in sorted((resource_dir("scenarios") / folder).glob("*.yaml"))}


def shipped_safety() -> dict[str, Path]:
    """Names, such as `safety/tip_limit`, and files of the scenarios that end early, one for each outcome."""
    return {f"safety/{name}": path for name, path in shipped("safety").items()}


def find(name: str | os.PathLike[str], folder: str, kind: str) -> Path:
    """The file that `name` means: a path, or the name of a shipped file if it is a string.

    Raises:
        ScenarioError: If it is neither.
    """
    if not isinstance(name, str):
        return Path(name)
    path = Path(name)
    safety = not folder and name.startswith("safety/") and not path.exists()
    known = shipped_safety() if safety else shipped(folder)
    if name in known:
        return known[name]
    if path.suffix in (".yaml", ".yml") or (len(path.parts) > 1 and not safety):
        return path
    raise ScenarioError("", f"{unknown_name(name, f'shipped {kind}', known)} Or give a .yaml file.")


def load_scenario(
    source: Source | Scenario,
    *,
    controller: Source | ControllerConfig | None = None,
    assignments: Sequence[str] = (),
    seed: int | None = None,
) -> Scenario:
    """Load a scenario by path or shipped name, or check one that is given.

    Args:
        source: Path of a YAML file, name of a shipped or drawn scenario, the content as a mapping, or a
            scenario. A drawn one without a number in its name is that of the seed.
        controller: Controller to use instead of the scenario's own: a path, a shipped name, or the content.
        assignments: `key.path=value` overrides, applied after the controller is put in place.
        seed: Seed to use instead of the scenario's own.

    Raises:
        ScenarioError: If anything is wrong, naming file, line and key.
    """
    document = _document(source, seed)
    if controller is not None:
        document = _instead(document, controller)
    document = _with_controller(document, from_option=controller is not None)
    for assignment in assignments:
        document = _with_controller(set_value(document, assignment), from_option=True)
    if seed is not None:
        document = set_value(document, f"seed={_checked_seed(seed)}")
    return validate(Scenario, document)


def _document(source: Source | Scenario, seed: int | None) -> YamlDocument:
    if isinstance(source, str) and (drawn := drawn_document(source, seed)) is not None:
        return drawn
    if isinstance(source, str | os.PathLike):
        return _beside_it(read_yaml(find(source, "", "scenario")))
    if isinstance(source, Mapping | Scenario):
        return document_of(source)
    raise ScenarioError("", f"a {type(source).__name__} is no scenario: give a name, a path or a mapping")


def _beside_it(document: YamlDocument) -> YamlDocument:
    """`document` with paths of files of arm, instrument and channels from the scenario's own folder on."""
    folder, tree = Path(document.source).parent.absolute(), dict(document.tree)
    for part in ("robot", "instrument"):
        given = tree.get(part)
        if isinstance(given, dict):
            whole = {key: str(folder / given[key]) for key in KINDS if isinstance(given.get(key), str)}
            tree[part] = {**given, **whole}
    if isinstance(tree.get("task"), dict):
        tree["task"] = _traced(tree["task"], folder)
    return replace(document, tree=tree)


def _traced(task: dict[str, Any], folder: Path) -> dict[str, Any]:
    """`task` with the paths of the traces of its channels from `folder` on."""
    found = dict(task)
    for key, channel in task.items():
        if isinstance(channel, dict) and isinstance(channel.get("trace"), str):
            found[key] = {**channel, "trace": str(folder / channel["trace"])}
    return found


def _instead(document: YamlDocument, controller: Source | ControllerConfig) -> YamlDocument:
    """`document` with another controller; one that is given is checked first, so that its errors name it."""
    if isinstance(controller, str):
        return replace(document, tree={**document.tree, "controller": controller})
    if not isinstance(controller, os.PathLike | Mapping | ControllerConfig):
        reason = f"a {type(controller).__name__} is no controller: give a name, a path or a mapping"
        raise ScenarioError("--controller", reason)
    config = load_controller(controller)
    return replace(document, tree={**document.tree, "controller": json.loads(config.model_dump_json())})


def _checked_seed(seed: int) -> int:
    if isinstance(seed, bool) or not hasattr(seed, "__index__"):
        raise ScenarioError("--seed", f"{show_with_kind(seed)} is not an integer")
    if seed < 0:
        raise ScenarioError("--seed", f"{seed} is not allowed: must be 0 or more")
    if seed >= 2**63:
        raise ScenarioError(
            "--seed", f"{one_line(str(seed))} is out of range: an integer has at most 63 bits"
        )
    return operator.index(seed)


def load_controller(source: Source | ControllerConfig) -> ControllerConfig:
    """Load a controller by path or shipped name, or check one that is given.

    Raises:
        ScenarioError: If anything is wrong, naming file, line and key.
    """
    if isinstance(source, Mapping | ControllerConfig):
        return validate(ControllerConfig, document_of(source, _GIVEN_CONTROLLER))
    return validate(ControllerConfig, read_yaml(find(source, "controllers", "controller")))


def _with_controller(document: YamlDocument, *, from_option: bool) -> YamlDocument:
    """`document` with a controller given by name replaced by that controller's content.

    The controller's file is checked first, so that its errors name it.
    """
    name = document.tree.get("controller")
    if not isinstance(name, str):
        return document
    if Path(name).suffix in (".yaml", ".yml") and not from_option and not Path(name).is_absolute():
        name = str(Path(document.source).parent / name)
    try:
        path = find(name, "controllers", "controller")
        tree = read_yaml(path).tree
    except ScenarioError as error:
        if error.where:
            raise
        where = "--controller" if from_option else document.where(("controller",))
        raise ScenarioError(where, error.reason) from error
    load_controller(str(path))
    return replace(document, tree=_replaced(document.tree, tree))


def _replaced(tree: Mapping[str, Any], controller: Mapping[str, Any]) -> dict[str, Any]:
    return {**tree, "controller": dict(controller)}
