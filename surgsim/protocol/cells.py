"""The runs that a protocol asks of a controller."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from surgsim.compare.axis import AxisConfig
from surgsim.control.controller import ControllerConfig
from surgsim.errors import ScenarioError
from surgsim.protocol.definition import GeneratorConfig, Protocol, TrackConfig, merged
from surgsim.protocol.seeds import Seeds
from surgsim.scenario.drawn import drawn_document
from surgsim.scenario.load import load_controller, load_scenario
from surgsim.scenario.schema import Scenario

BASE = "base"
"""Stands in a cell's id where no axis is changed."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A run that is asked for.

    Attributes:
        generator: The generator of its scenario.
        arm: The robot.
        axis: The quantity that is changed; empty where none is.
        level: Its level; None where none is.
        seed: The seed.
        scenario: All of the scenario, the controller in it; None where the controller does not fit it.
        refusal: Why it does not; empty if it does.
    """

    generator: str
    arm: str
    axis: str = ""
    level: float | None = None
    seed: int
    scenario: Scenario | None
    refusal: str = ""

    @property
    def id(self) -> str:
        """`generator/arm/axis=level/seed`; `base` where no axis is changed."""
        point = BASE if self.level is None else f"{self.axis}={self.level:g}"
        return f"{self.generator}/{self.arm}/{point}/{self.seed}"


@dataclass(frozen=True, kw_only=True)
class _Point:
    """A generator with no axis changed, or with one at a level."""

    axis: str = ""
    level: float | None = None
    assignments: tuple[str, ...] = ()
    seeds: tuple[int, ...] = ()


def cells(
    protocol: Protocol,
    track: str,
    arms: Sequence[str],
    seeds: Seeds,
    controller: ControllerConfig,
    scheme: str = "",
) -> tuple[Cell, ...]:
    """Every run of a track for these arms, sorted by id.

    Raises:
        SurgsimError: If the track has no such scheme.
        ScenarioError: If the protocol itself makes a scenario that is not valid.
    """
    chosen = protocol.track(track)
    served, settings = serving(chosen, controller), protocol.settings_of(track, scheme)
    found = [
        cell
        for name in chosen.generators
        for arm in arms
        for cell in cells_of(protocol, name, arm, seeds, served, settings)
    ]
    return tuple(sorted(found, key=lambda cell: cell.id))


def serving(track: TrackConfig, controller: ControllerConfig) -> ControllerConfig:
    """`controller` as the track runs it: with the track's servo, if it has one, below its velocities."""
    if track.servo is None:
        return controller
    return load_controller({**controller.model_dump(mode="json"), **track.servo})


def cells_of(
    protocol: Protocol,
    generator: str,
    arm: str,
    seeds: Seeds,
    controller: ControllerConfig,
    settings: tuple[str, ...] = (),
    most_seeds: int | None = None,
) -> Iterator[Cell]:
    """Every run of one generator with one arm, with these `key.path=value` settings in all of them.

    Args:
        protocol: The protocol.
        generator: Name of the generator.
        arm: The robot.
        seeds: Where seeds come from.
        controller: The controller.
        settings: `key.path=value` settings of all runs.
        most_seeds: Only so many seeds at each point; None: as many as the generator says.

    Raises:
        ScenarioError: If the protocol itself makes a scenario that is not valid.
    """
    config = protocol.config.generators[generator]
    for point in _points(config, seeds, generator):
        for seed in point.seeds[:most_seeds]:
            tree = scenario_tree(protocol, generator, arm, seed)
            scenario, refusal = _load(tree, (*settings, *point.assignments), seed, controller)
            yield Cell(
                generator=generator,
                arm=arm,
                axis=point.axis,
                level=point.level,
                seed=seed,
                scenario=scenario,
                refusal=refusal,
            )


def scenario_tree(protocol: Protocol, generator: str, arm: str, seed: int) -> dict[str, Any]:
    """Keys of the scenario with no axis changed, without a controller."""
    config, whole = protocol.config.generators[generator], protocol.config
    below: Mapping[str, Any] = {"robot": {"name": arm}}
    if config.drawn:
        drawn = drawn_document(f"random_{arm}", seed)
        assert drawn is not None
        below = drawn.tree
    else:
        below = merged(below, whole.arms[arm])
    tree = merged(merged(below, config.base), config.arms.get(arm, {}))
    tree["disturbances"] = [*tree.get("disturbances", ()), *config.adds]
    tree["thresholds"] = whole.thresholds.model_dump(mode="json")
    return {**tree, "name": f"{generator}_{arm}", "description": config.description}


def reference() -> ControllerConfig:
    """A controller that fits every scenario: what is asked where a scenario is meant, not a controller."""
    return load_controller(
        {"name": "reference", "resolver": {"type": "pinv"}, "torque_law": {"type": "joint_impedance"}}
    )


def _load(
    tree: Mapping[str, Any], assignments: Sequence[str], seed: int, controller: ControllerConfig
) -> tuple[Scenario | None, str]:
    """The scenario; None, and why, where this controller does not fit it and the reference does."""
    try:
        return load_scenario(tree, controller=controller, assignments=assignments, seed=seed), ""
    except ScenarioError as error:
        load_scenario(tree, controller=reference(), assignments=assignments, seed=seed)
        return None, str(error)


def _points(config: GeneratorConfig, seeds: Seeds, generator: str) -> Iterator[_Point]:
    yield _Point(seeds=seeds.of(generator, config.seeds))
    for name, axis in config.axes.items():
        yield from _levels(name, axis, seeds.of(generator, config.level_seeds))


def _levels(name: str, axis: AxisConfig, seeds: tuple[int, ...]) -> Iterator[_Point]:
    for place, level in enumerate(axis.levels):
        yield _Point(axis=name, level=level, assignments=axis.assignments(place, None), seeds=seeds)
