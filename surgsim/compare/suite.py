"""A suite: scenarios, controllers, a grid of parameters and seeds, and the runs that they make."""

import itertools
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, FiniteFloat, field_validator, model_validator

from surgsim.catalog import Name, PartConfig
from surgsim.compare.axis import AxisConfig, Values
from surgsim.compare.matters import checked_matters
from surgsim.errors import ScenarioError, SurgsimError, unknown_name
from surgsim.metrics.catalog import METRICS
from surgsim.scenario.arms import Experiment
from surgsim.scenario.drawn import drawn_names
from surgsim.scenario.load import find, load_experiment, shipped
from surgsim.scenario.validate import validate
from surgsim.scenario.yaml_text import read_yaml

MOST_RUNS = 100_000


def parse_seeds(text: str) -> tuple[int, ...]:
    """Seeds from `0:10` (0 to 9), `3` or `1,4,9`.

    Raises:
        ValueError: If the text is none of these, or names no seed.
    """
    seeds: list[int] = []
    shown = text if len(text) <= 60 else f"{text[:57]}..."
    for part in text.split(","):
        match = re.fullmatch(r"\s*([0-9]{1,9})(?::([0-9]{1,9}))?\s*", part)
        if not match:
            raise ValueError(f"'{shown}' is not a list of seeds: write 0:10, 3 or 1,4,9")
        first = int(match[1])
        last = int(match[2]) if match[2] else first + 1
        seeds.extend(range(first, min(last, first + MOST_RUNS + 1)))  # one too many is refused below
    if not seeds or len(set(seeds)) != len(seeds) or len(seeds) > MOST_RUNS:
        raise ValueError(f"'{shown}' must name between one and {MOST_RUNS} different seeds")
    return tuple(seeds)


def _check_seeds(text: str) -> str:
    parse_seeds(text)
    return text


class GivenConfig(PartConfig):
    """What a suite names that has no file: its content in place.

    Attributes:
        scenarios: Content by the name that the suite's `scenarios` use.
        controllers: The same of its `controllers`.
    """

    scenarios: dict[Name, dict[str, Any]] = Field(default_factory=dict)
    controllers: dict[Name, dict[str, Any]] = Field(default_factory=dict)


class SuiteConfig(PartConfig):
    """A batch comparison.

    Attributes:
        name: What its results are called.
        description: One line about it.
        scenarios: Shipped names, or paths from the suite's file.
        controllers: Shipped names, or paths from the suite's file; null: each scenario's own.
        grid: Key paths of the scenario with the values each takes; every combination is run.
        axes: Named quantities whose levels are combined as those of the grid are.
        sweeps: Named quantities that are varied one at a time, beside a run with none of them.
        seeds: `0:10`, `3` or `1,4,9`.
        record: Whether every run writes its recording.
        settings: `key.path=value` settings of every run.
        matters: Smallest differences that matter, by metric, in its unit; the metrics' own for the others.
        given: Scenarios and controllers in place, by the names that stand above.
    """

    name: Name
    description: str = ""
    scenarios: Annotated[tuple[str, ...], Field(min_length=1)]
    controllers: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    grid: dict[str, Values] = Field(default_factory=dict)
    axes: dict[Name, AxisConfig] = Field(default_factory=dict)
    sweeps: dict[Name, AxisConfig] = Field(default_factory=dict)
    seeds: Annotated[str, AfterValidator(_check_seeds)] = "0"
    record: bool = False
    settings: tuple[str, ...] = ()
    matters: dict[str, Annotated[FiniteFloat, Field(ge=0.0)]] = Field(default_factory=dict)
    given: GivenConfig = GivenConfig()

    @field_validator("matters")
    @classmethod
    def _of_metrics(cls, matters: dict[str, float]) -> dict[str, float]:
        for name in matters:
            if name not in METRICS:
                raise ValueError(unknown_name(name, "metric", METRICS))
        return matters

    @model_validator(mode="after")
    def _seeds_have_one_place(self) -> Self:
        """A run's seed is set last: one in the grid or the settings would be passed over."""
        keys = (*self.grid, *(setting.partition("=")[0] for setting in self.settings))
        if any(key.strip() == "seed" for key in keys):
            raise ValueError("seed cannot be in grid or settings: the seeds of a suite are its key seeds")
        return self

    @model_validator(mode="after")
    def _axes_are_told_apart(self) -> Self:
        """A table's parameters are named by key path or axis; both in one name would hide one."""
        names = [*self.grid, *self.axes, *self.sweeps]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"{', '.join(twice)} is named twice among grid, axes and sweeps")
        for name, axis in (*self.axes.items(), *self.sweeps.items()):
            if strangers := sorted(set(axis.controllers) - set(self.controllers or ())):
                raise ValueError(f"{name} names {', '.join(strangers)}, no controller of the suite")
        return self


@dataclass(frozen=True, kw_only=True)
class RunSpec:
    """One run of a suite.

    Attributes:
        scenario: Name or path of the scenario.
        controller: Name or path of the controller, or None for the scenario's own.
        given: Content of those that have no file.
        parameters: This run's point: key paths of the grid with their values, axes with their levels.
        settings: `key.path=value` settings of every run.
        assignments: The same of this point.
        seed: Its seed.
        record: Whether it writes its recording.
    """

    scenario: str
    controller: str | None
    given: GivenConfig
    parameters: tuple[tuple[str, Any], ...]
    settings: tuple[str, ...]
    assignments: tuple[str, ...]
    seed: int
    record: bool

    def load(self) -> Experiment:
        """The run's scenario.

        Raises:
            ScenarioError: If it is not valid.
        """
        scenario, controller = self.scenario, self.controller
        return load_experiment(
            self.given.scenarios.get(scenario, scenario),
            controller=None if controller is None else self.given.controllers.get(controller, controller),
            assignments=(*self.settings, *self.assignments),
            seed=self.seed,
        )


def load_suite(name: str) -> tuple[SuiteConfig, Path]:
    """A suite by path or shipped name, with the folder that its paths are relative to.

    Raises:
        ScenarioError: If anything is wrong with it.
    """
    path = find(name, "suites", "suite")
    return validate(SuiteConfig, read_yaml(path)), path.parent


def is_suite(name: str) -> bool:
    """Whether `name` is a shipped suite, or a file that says `scenarios`."""
    if name in shipped("suites"):
        return True
    path = Path(name)
    if name in shipped() or path.suffix not in (".yaml", ".yml"):
        return False
    return "scenarios" in read_yaml(path).tree


def ad_hoc_suite(scenarios: Sequence[str], controllers: Sequence[str] | None) -> SuiteConfig:
    """A suite of scenarios named on the command line."""
    names = [Path(scenario).stem for scenario in scenarios]
    name = names[0] if len(names) == 1 else f"{names[0]}_and_{len(names) - 1}_more"
    return SuiteConfig(
        name=re.sub(r"[^a-z0-9_]", "_", name.lower()).lstrip("_")[:64] or "suite",
        scenarios=tuple(scenarios),
        controllers=tuple(controllers) if controllers else None,
    )


def expand(suite: SuiteConfig, folder: Path) -> list[RunSpec]:
    """Every run of `suite`, in a fixed order.

    Raises:
        SurgsimError: If there are too many, or an axis says nothing of a controller.
    """
    controllers = suite.controllers or (None,)
    seeds = parse_seeds(suite.seeds)
    for name, axis in (*suite.axes.items(), *suite.sweeps.items()):
        if silent := axis.sets_nothing_for(controllers):
            raise SurgsimError(f"suite '{suite.name}': {name} sets nothing for {', '.join(silent)}")
    count = len(suite.scenarios) * len(controllers) * _count_points(suite) * len(seeds)
    if count > MOST_RUNS:
        raise SurgsimError(f"suite '{suite.name}' has {count} runs; at most {MOST_RUNS} are allowed")
    return [
        RunSpec(
            scenario=_near(scenario, folder),
            controller=None if controller is None else _near(controller, folder),
            given=suite.given,
            parameters=point.parameters,
            settings=suite.settings,
            assignments=point.assignments,
            seed=seed,
            record=suite.record,
        )
        for scenario, controller in itertools.product(suite.scenarios, controllers)
        for point, seed in itertools.product(_points(suite, controller), seeds)
    ]


@dataclass(frozen=True, kw_only=True)
class _Point:
    """A point of grid, axes and sweeps: what the table calls it, and what it sets."""

    parameters: tuple[tuple[str, Any], ...] = ()
    assignments: tuple[str, ...] = ()

    def __add__(self, other: "_Point") -> "_Point":
        return _Point(
            parameters=self.parameters + other.parameters, assignments=self.assignments + other.assignments
        )


def _count_points(suite: SuiteConfig) -> int:
    crossed = [len(values) for values in suite.grid.values()] + [len(a.levels) for a in suite.axes.values()]
    return math.prod(crossed) * (1 + sum(len(sweep.levels) for sweep in suite.sweeps.values()))


def _points(suite: SuiteConfig, controller: str | None) -> list[_Point]:
    """Every combination of grid and axes, each alone and with every level of every sweep."""
    factors = [
        [_Point(parameters=((key, value),), assignments=(f"{key}={json.dumps(value)}",)) for value in values]
        for key, values in suite.grid.items()
    ]
    factors += [_levels(name, axis, controller) for name, axis in suite.axes.items()]
    sweeps = [point for name, sweep in suite.sweeps.items() for point in _levels(name, sweep, controller)]
    factors.append([_Point(), *sweeps])
    return [sum(combination, _Point()) for combination in itertools.product(*factors)]


def _levels(name: str, axis: AxisConfig, controller: str | None) -> list[_Point]:
    return [
        _Point(parameters=((name, level),), assignments=axis.assignments(place, controller))
        for place, level in enumerate(axis.levels)
    ]


def _near(name: str, folder: Path) -> str:
    """`name`, with a relative path taken from the suite's folder."""
    path = Path(name)
    if path.suffix in (".yaml", ".yml") and not path.is_absolute():
        return str(folder / path)
    return name


def check_runs(specs: Sequence[RunSpec]) -> list[Experiment]:
    """The scenario of every run, each checked before any of them is run.

    Raises:
        ScenarioError: For the first that is not valid.
    """
    scenarios: dict[tuple[Any, ...], Experiment] = {}
    checked: list[Experiment] = []
    for spec in specs:
        drawn = spec.seed if spec.scenario in drawn_names() else None
        key = (spec.scenario, drawn, spec.controller, spec.assignments, spec.settings)
        if key not in scenarios:
            scenarios[key] = spec.load()
        checked.append(scenarios[key].model_copy(update={"seed": spec.seed}))
    return checked


def with_changes(
    suite: SuiteConfig,
    controllers: Sequence[str] | None,
    seeds: str | None,
    record: bool,
    settings: Sequence[str] = (),
    matters: Mapping[str, float] | None = None,
) -> SuiteConfig:
    """`suite` with what the command line says instead; its `key.path=value` settings hold in every run.

    Raises:
        SurgsimError: If the seeds cannot be read, a setting is of a key that the suite itself varies, or a
            smallest difference is not allowed.
    """
    for setting in settings:
        _check_setting(suite, setting)
    changes: dict[str, Any] = {
        "record": suite.record or record,
        "settings": (*suite.settings, *settings),
        "matters": {**suite.matters, **checked_matters(matters or {})},
    }
    if controllers is not None:
        changes["controllers"] = tuple(_from_here(name) for name in controllers)
    if seeds is not None:
        try:
            parse_seeds(seeds)
        except ValueError as error:
            raise ScenarioError("--seeds", str(error)) from error
        changes["seeds"] = seeds
    return suite.model_copy(update=changes)


def _check_setting(suite: SuiteConfig, setting: str) -> None:
    """Refuse a setting that runs would not follow, as the suite sets the key for each of them."""
    key = setting.partition("=")[0].strip()
    where = f"--set {setting}"
    if key == "seed":
        raise ScenarioError(where, "the seeds of a suite are given by --seeds")
    if key == "controller":
        raise ScenarioError(where, "the controllers of a suite are given by --controllers")
    varied = [name for name in suite.grid if _one_inside_the_other(name, key)]
    for name, axis in (*suite.axes.items(), *suite.sweeps.items()):
        if any(_one_inside_the_other(touched, key) for touched in axis.touched_keys()):
            varied.append(name)
    if varied:
        raise ScenarioError(where, f"suite '{suite.name}' varies this itself: {', '.join(varied)}")


def _one_inside_the_other(a: str, b: str) -> bool:
    return f"{a}.".startswith(f"{b}.") or f"{b}.".startswith(f"{a}.")


def _from_here(name: str) -> str:
    """`name`, with a relative path taken from the working directory: the user typed it there."""
    return str(Path(name).absolute()) if Path(name).suffix in (".yaml", ".yml") else name
