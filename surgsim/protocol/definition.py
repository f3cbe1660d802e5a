"""A protocol as data: arms, generators of scenarios, tracks, thresholds, figures."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PositiveInt, model_validator

from surgsim.catalog import Name, PartConfig
from surgsim.compare.axis import AxisConfig
from surgsim.errors import ScenarioError, SurgsimError, unknown_name
from surgsim.metrics.catalog import SHIPPED
from surgsim.metrics.timing import TIMING_METRICS
from surgsim.models.folders import robot_names
from surgsim.resources import resource_dir
from surgsim.scenario.load import shipped
from surgsim.scenario.thresholds import ThresholdsConfig
from surgsim.scenario.validate import validate
from surgsim.scenario.yaml_text import read_yaml

FOLDER = "protocols"
CURRENT = "surgsim_v1"
"""The protocol that is scored where none is named."""
Part = dict[str, Any]
"""A part of a scenario: its keys, as in a scenario's file."""
Some = Annotated[tuple[str, ...], Field(min_length=1)]


class GeneratorConfig(PartConfig):
    """What makes scenarios of one kind, for every arm.

    A scenario is `base`, over it the arm's own places, over it the arm's entry of `arms`. A drawn one begins
    with the scenario that the seed draws for the arm instead.

    Attributes:
        description: One line about it.
        drawn: Whether port, path and loads are drawn by the seed, all around the arm.
        base: Keys of the scenario, the same for all arms.
        arms: Keys of one arm alone.
        adds: Disturbances after those that are there.
        seeds: Runs with no axis changed.
        level_seeds: Runs at each level of each axis.
        axes: Quantities that are varied one at a time; levels rise with the difficulty.
    """

    description: str
    drawn: bool = False
    base: Part = Field(default_factory=dict)
    arms: dict[Name, Part] = Field(default_factory=dict)
    adds: tuple[Part, ...] = ()
    seeds: PositiveInt
    level_seeds: PositiveInt = 1
    axes: dict[Name, AxisConfig] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _axes_are_for_all(self) -> Self:
        for name, axis in self.axes.items():
            if axis.controllers:
                raise ValueError(f"axis {name} sets keys of some controllers: it must be the same for all")
        return self


class TrackConfig(PartConfig):
    """A competition: what a controller may know, and what it is run on.

    Attributes:
        description: One line about it.
        generators: Names of its generators.
        ports: Port estimators that may be used.
        instruments: Instrument estimators that may be used.
        servo: Keys of the controller that take the place of the entrant's own: what follows its velocities.
        schemes: Variants of the operator's side that may be entered, each with its settings of the scenario.
        entries: Shipped controllers of the leaderboard: names, or paths from the folder of shipped scenarios;
            with a scheme, `name+scheme`.
        baselines: Those of them that a passport is drawn beside.
    """

    description: str
    generators: Some
    ports: Some
    instruments: Some
    servo: Part | None = None
    schemes: dict[Name, tuple[str, ...]] = Field(default_factory=dict)
    entries: Some
    baselines: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _baselines_enter(self) -> Self:
        if strangers := sorted(set(self.baselines) - set(self.entries)):
            raise ValueError(f"baseline {strangers[0]} is no entry of the track")
        return self


class FigureConfig(PartConfig):
    """A number of the scorecard.

    Attributes:
        label: What it is, with its unit in brackets.
        kind: A share of runs that `completed` or are `done`; a `quantile` of a metric over runs, those that
            failed as the worst; or the share of an axis' levels that is `held`.
        metric: The metric of a quantile.
        quantile: Which one.
        margin: Differences below this are none: equivalence is claimed within it.
        margin_source: Where that comes from.
    """

    label: str
    kind: Literal["completed", "done", "quantile", "held"]
    metric: str | None = None
    quantile: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95
    margin: Annotated[float, Field(ge=0.0)]
    margin_source: str

    @model_validator(mode="after")
    def _of_a_metric(self) -> Self:
        if (self.kind == "quantile") != (self.metric is not None):
            raise ValueError("a quantile, and no other kind, needs metric")
        return self


class ProtocolConfig(PartConfig):
    """A protocol.

    Attributes:
        name: Its name, which stands for all of it.
        description: One line about it.
        draft: Whether it may still be frozen again: no round of it has been opened.
        arms: Robots, each with the keys of the scenario that are its own: port, posture, start.
        thresholds: What every run is held against.
        generators: What makes scenarios.
        tracks: Competitions.
        metrics: Metrics that rows keep.
        figures: Numbers of the scorecard.
    """

    name: Name
    description: str
    draft: bool
    arms: Annotated[dict[Name, Part], Field(min_length=1)]
    thresholds: ThresholdsConfig
    generators: Annotated[dict[Name, GeneratorConfig], Field(min_length=1)]
    tracks: Annotated[dict[Name, TrackConfig], Field(min_length=1)]
    metrics: Some
    figures: Annotated[dict[Name, FigureConfig], Field(min_length=1)]

    @model_validator(mode="after")
    def _names_are_known(self) -> Self:
        for arm in self.arms:
            if arm not in robot_names():
                raise ValueError(unknown_name(arm, "robot", robot_names()))
        for name, track in self.tracks.items():
            for generator in track.generators:
                if generator not in self.generators:
                    raise ValueError(f"track {name}: {unknown_name(generator, 'generator', self.generators)}")
        for metric in self.metrics:
            if metric not in SHIPPED:
                raise ValueError(unknown_name(metric, "metric", SHIPPED))
            if metric in TIMING_METRICS:
                raise ValueError(f"metric {metric} depends on the machine: rows cannot keep it")
        for name, figure in self.figures.items():
            if figure.metric is not None and figure.metric not in self.metrics:
                raise ValueError(f"figure {name}: {figure.metric} is not among the protocol's metrics")
        return self


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """A protocol and the place of its files.

    Attributes:
        config: The protocol.
        path: Its file.
    """

    config: ProtocolConfig
    path: Path

    @property
    def name(self) -> str:
        """Its name."""
        return self.config.name

    @property
    def lock(self) -> Path:
        """The file of its hashes."""
        return self.path.with_suffix(".lock.json")

    @property
    def rounds(self) -> Path:
        """The file of its rounds."""
        return self.path.with_suffix(".rounds.json")

    def track(self, name: str) -> TrackConfig:
        """The track called `name`.

        Raises:
            SurgsimError: If there is none.
        """
        if name not in self.config.tracks:
            raise SurgsimError(f"--track: {unknown_name(name, 'track', self.config.tracks)}")
        return self.config.tracks[name]

    def settings_of(self, track: str, scheme: str) -> tuple[str, ...]:
        """Settings of a track's scheme; none for the empty name, which is that of a track without schemes.

        Raises:
            SurgsimError: If the track has no such scheme.
        """
        schemes = self.track(track).schemes
        if not scheme and not schemes:
            return ()
        if scheme not in schemes:
            known = unknown_name(scheme, "scheme", schemes)
            raise SurgsimError(f"--scheme: track '{track}': {known}" if schemes else f"--scheme: {known}")
        return schemes[scheme]

    def arms_of(self, names: str | None) -> tuple[str, ...]:
        """Arms from `a,b`, in the protocol's order; all for None.

        Raises:
            SurgsimError: If one is not the protocol's.
        """
        asked = list(self.config.arms) if names is None else names.split(",")
        for arm in asked:
            if arm not in self.config.arms:
                raise SurgsimError(f"--arms: {unknown_name(arm, 'robot of the protocol', self.config.arms)}")
        return tuple(arm for arm in self.config.arms if arm in asked)


def protocol_names() -> list[str]:
    """Names of the shipped protocols."""
    return sorted(shipped(FOLDER))


def load_protocol(name: str = CURRENT) -> Protocol:
    """A protocol by the name of a shipped one, or by its file.

    Raises:
        ScenarioError: If there is none, or anything is wrong with it.

    Example:
        >>> load_protocol("surgsim_v1").name
        'surgsim_v1'
    """
    known = shipped(FOLDER)
    path = known.get(name, Path(name))
    if name not in known and path.suffix not in (".yaml", ".yml"):
        raise ScenarioError("--protocol", f"{unknown_name(name, 'protocol', known)} Or give a .yaml file.")
    config = validate(ProtocolConfig, read_yaml(path))
    if config.name != path.stem:
        raise ScenarioError(str(path), f"it is the protocol '{config.name}': a protocol's file has its name")
    return Protocol(config=config, path=path)


def entry_file(entry: str) -> str:
    """What loads an entry of a track: its name, or the path of one in the folder of shipped scenarios."""
    name = entry.partition("+")[0]
    return str(resource_dir("scenarios") / name) if name.endswith(".yaml") else name


def entry_scheme(entry: str) -> str:
    """The scheme of an entry; empty without one."""
    return entry.partition("+")[2]


def entry_label(name: str) -> str:
    """What tables call an entry: tuned gains of a shipped controller are told apart from its own.

    Example:
        >>> entry_label("tuned/rcm_mpc.yaml"), entry_label("rcm_mpc")
        ('rcm_mpc_tuned', 'rcm_mpc')
    """
    path, scheme = Path(name.partition("+")[0]), entry_scheme(name)
    return with_scheme(f"{path.stem}_tuned" if path.parent.name == "tuned" else path.stem, scheme)


def with_scheme(name: str, scheme: str) -> str:
    """What tables call a controller with a scheme; `name` without one."""
    return f"{name}_{scheme}" if scheme else name


def merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """`below` with the keys of `above`; mappings in both are merged, anything else is replaced."""
    found = dict(below)
    for key, value in above.items():
        old = found.get(key)
        found[key] = merged(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return found
