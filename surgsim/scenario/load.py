"""Finding and loading scenario and controller files."""

import copy
import json
import operator
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from surgsim.control.controller import ControllerConfig
from surgsim.errors import ScenarioError, unknown_name
from surgsim.resources import resource_dir
from surgsim.scenario.arms import NOT_BESIDE_ARMS, ArmsScenario, Experiment
from surgsim.scenario.drawn import drawn_document
from surgsim.scenario.files import files_in
from surgsim.scenario.messages import one_line, show_with_kind
from surgsim.scenario.plain import document_of
from surgsim.scenario.schema import Scenario
from surgsim.scenario.validate import validate
from surgsim.scenario.yaml_events import KeyPath
from surgsim.scenario.yaml_text import YamlDocument, read_yaml, set_value

Source = str | os.PathLike[str] | Mapping[str, Any]
"""A shipped name, a path, or the content itself."""
_GIVEN_CONTROLLER = "given controller"


def shipped(folder: str = "") -> dict[str, Path]:
    """Names and files of the shipped scenarios, or of `controllers` and the like."""
    return {path.stem: path for path in sorted((resource_dir("scenarios") / folder).glob("*.yaml"))}


def of_one_arm(files: Mapping[str, Path]) -> list[str]:
    """Those of shipped scenarios that have one arm: what is made for one is made for each of them."""
    return [name for name, path in files.items() if "\narms:" not in path.read_text(encoding="utf-8")]


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
    """Load a scenario of one arm, for what is not made for several; as `load_experiment`.

    Raises:
        ScenarioError: As there, and if it has several arms.
    """
    document = _given(source, controller, assignments, seed)
    if "arms" in document.tree:
        raise ScenarioError(
            document.where(("arms",)),
            "a scenario of one arm is needed here; several are run by surgsim.run and surgsim.compare",
        )
    return validate(Scenario, document)


def load_experiment(
    source: Source | Experiment,
    *,
    controller: Source | ControllerConfig | None = None,
    assignments: Sequence[str] = (),
    seed: int | None = None,
) -> Experiment:
    """Load a scenario by path or shipped name, or check one that is given.

    Args:
        source: Path of a YAML file, name of a shipped or drawn scenario, the content as a mapping, or a
            scenario. A drawn one without a number in its name is that of the seed.
        controller: Controller to use instead of the scenario's own, for each arm: a path, a shipped name, or
            the content.
        assignments: `key.path=value` overrides, applied after the controller is put in place.
        seed: Seed to use instead of the scenario's own.

    Raises:
        ScenarioError: If anything is wrong, naming file, line and key.
    """
    document = _given(source, controller, assignments, seed)
    if "arms" not in document.tree:
        return validate(Scenario, document)
    for key, reason in NOT_BESIDE_ARMS.items():
        if key in document.tree:
            raise ScenarioError(document.where((key,)), f"not beside arms: {reason}")
    return validate(ArmsScenario, document)


def _given(
    source: Source | Experiment,
    controller: Source | ControllerConfig | None,
    assignments: Sequence[str],
    seed: int | None,
) -> YamlDocument:
    """The document with what is to be otherwise, its controllers' contents in the place of their names."""
    document = _document(source, seed)
    if controller is not None:
        document = _instead(document, controller)
    document = _with_controller(document, from_option=controller is not None)
    for assignment in assignments:
        document = _with_controller(set_value(document, assignment), from_option=True)
    if seed is not None:
        document = set_value(document, f"seed={_checked_seed(seed)}")
    return document


def _document(source: Source | Experiment, seed: int | None) -> YamlDocument:
    if isinstance(source, str) and (drawn := drawn_document(source, seed)) is not None:
        return drawn
    if isinstance(source, str | os.PathLike):
        return _beside_it(read_yaml(find(source, "", "scenario")))
    if isinstance(source, Mapping | Scenario | ArmsScenario):
        return document_of(source)
    raise ScenarioError("", f"a {type(source).__name__} is no scenario: give a name, a path or a mapping")


def _beside_it(document: YamlDocument) -> YamlDocument:
    """`document` with paths of files of arm, instrument and channels from the scenario's own folder on."""
    folder, tree = Path(document.source).parent.absolute(), copy.deepcopy(dict(document.tree))
    for _, holder in _holders(tree):
        for mapping, key in files_in(holder):
            mapping[key] = str(folder / mapping[key])
    return replace(document, tree=tree)


def _holders(tree: dict[str, Any]) -> list[tuple[KeyPath, dict[str, Any]]]:
    """The mappings that have a robot and a controller, and where: the scenario itself, or each arm."""
    arms = tree.get("arms")
    if "arms" not in tree:
        return [((), tree)]
    given = arms if isinstance(arms, list) else []
    return [(("arms", k), arm) for k, arm in enumerate(given) if isinstance(arm, dict)]


def _instead(document: YamlDocument, controller: Source | ControllerConfig) -> YamlDocument:
    """`document` with another controller; one that is given is checked first, so that its errors name it."""
    if isinstance(controller, str):
        return _with_each(document, controller)
    if not isinstance(controller, os.PathLike | Mapping | ControllerConfig):
        reason = f"a {type(controller).__name__} is no controller: give a name, a path or a mapping"
        raise ScenarioError("--controller", reason)
    config = load_controller(controller)
    return _with_each(document, json.loads(config.model_dump_json()))


def _with_each(document: YamlDocument, controller: Any) -> YamlDocument:
    """`document` with that controller for each arm."""
    tree = copy.deepcopy(dict(document.tree))
    for _, holder in _holders(tree):
        holder["controller"] = controller
    return replace(document, tree=tree)


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
    """`document` with controllers given by name replaced by their contents.

    A controller's file is checked first, so that its errors name it.
    """
    tree = copy.deepcopy(dict(document.tree))
    for place, holder in _holders(tree):
        name = holder.get("controller")
        if isinstance(name, str):
            holder["controller"] = _content_of(document, place, name, from_option=from_option)
    return replace(document, tree=tree)


def _content_of(document: YamlDocument, place: KeyPath, name: str, *, from_option: bool) -> dict[str, Any]:
    """The content of the controller `name` of the mapping at `place`."""
    if Path(name).suffix in (".yaml", ".yml") and not from_option and not Path(name).is_absolute():
        name = str(Path(document.source).parent / name)
    try:
        path = find(name, "controllers", "controller")
        tree = read_yaml(path).tree
    except ScenarioError as error:
        if error.where:
            raise
        where = "--controller" if from_option else document.where((*place, "controller"))
        raise ScenarioError(where, error.reason) from error
    load_controller(str(path))
    return dict(tree)
