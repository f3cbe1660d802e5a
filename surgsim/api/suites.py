"""The suite that a call of `surgsim.compare` means."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from surgsim.compare.choice import suite_named
from surgsim.compare.suite import GivenConfig, SuiteConfig, with_changes
from surgsim.control.controller import ControllerConfig
from surgsim.errors import SurgsimError
from surgsim.scenario.arms import ArmsScenario, Experiment
from surgsim.scenario.load import Source, load_controller, load_experiment
from surgsim.scenario.schema import Scenario

Contents = dict[str, dict[str, Any]]


def suite_of(
    what: Source | Experiment | Sequence[Source | Experiment],
    controllers: Source | ControllerConfig | Sequence[Source | ControllerConfig] | None,
) -> tuple[SuiteConfig, Path]:
    """The suite, with the folder of its relative paths; what has no file is kept in it.

    Raises:
        SurgsimError: If nothing is named, a suite and scenarios are mixed, or something given is not valid.
    """
    scenarios: Contents = {}
    named = [_scenario(one, scenarios) for one in _several(what, "a suite, or scenarios")]
    suite, folder = suite_named(named, scenarios)
    if controllers is None:
        return _holding(suite, scenarios, {}), folder
    contents: Contents = {}
    names = [_controller(one, contents) for one in _several(controllers, "controllers")]
    return with_changes(_holding(suite, scenarios, contents), names, None, record=False), folder


def _several(given: Any, what: str) -> list[Any]:
    """`given` as a list; one alone is a list of one."""
    single = isinstance(given, str | os.PathLike | Mapping | Scenario | ArmsScenario | ControllerConfig)
    several = [given] if single else given
    if not isinstance(several, Sequence):
        raise SurgsimError(f"give {what}: a {type(given).__name__} is neither a name, a path nor a mapping")
    if not several:
        raise SurgsimError(f"give {what}; the list is empty")
    return list(several)


def _scenario(one: Source | Experiment, contents: Contents) -> str:
    """What the suite calls a scenario; the content of one that has no file is put into `contents`."""
    if isinstance(one, str | os.PathLike):
        return os.fspath(one)
    checked = load_experiment(one)
    _put(contents, checked.name, checked.resolved(), "scenarios")
    return checked.name


def _controller(one: Source | ControllerConfig, contents: Contents) -> str:
    """The same of a controller."""
    if isinstance(one, str | os.PathLike):
        return os.fspath(one)
    if not isinstance(one, Mapping | ControllerConfig):
        raise SurgsimError(f"a {type(one).__name__} is no controller: give a name, a path or a mapping")
    checked = load_controller(one)
    _put(contents, checked.name, checked.model_dump(mode="json"), "controllers")
    return checked.name


def _put(contents: Contents, name: str, content: dict[str, Any], what: str) -> None:
    if name in contents:
        raise SurgsimError(f"two of the {what} are called '{name}': give them different names")
    contents[name] = content


def _holding(suite: SuiteConfig, scenarios: Contents, controllers: Contents) -> SuiteConfig:
    """`suite` with the content of what it names."""
    given = GivenConfig(
        scenarios={**suite.given.scenarios, **scenarios},
        controllers={**suite.given.controllers, **controllers},
    )
    return suite.model_copy(update={"given": given})
