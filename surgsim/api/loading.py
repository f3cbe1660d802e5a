"""`surgsim.load`."""

from collections.abc import Mapping
from typing import Any

from surgsim.control.controller import ControllerConfig
from surgsim.scenario.load import Source, load_scenario
from surgsim.scenario.plain import assignments_of
from surgsim.scenario.schema import Scenario


def load(
    scenario: Source | Scenario,
    /,
    *,
    controller: Source | ControllerConfig | None = None,
    seed: int | None = None,
    settings: Mapping[str, Any] | None = None,
    **blocks: Any,
) -> Scenario:
    """Check a scenario, with changes, and return it with every default filled in.

    Args:
        scenario: Name of a shipped scenario, path of a YAML file, its content as a mapping, or a scenario; of
            one arm. One of several is run by `surgsim.run` and `surgsim.compare`.
        controller: Controller instead of the scenario's own: a name, a path, or its content as a mapping.
        seed: Seed instead of the scenario's own.
        settings: Values by key path, as `--set` of the command: `{"disturbances.0.mass_kg": 0.3}`.
        **blocks: Values by a scenario's top-level key. A mapping changes the keys that it names; one with the
            key `type`, and any other value, takes the place of what was there.

    Raises:
        ScenarioError: If anything is wrong, naming file, line and key.

    Example:
        >>> import surgsim
        >>> scenario = surgsim.load("circle_lwr4plus", task={"radius_m": 0.01}, disturbances=[])
        >>> scenario.task.radius_m, scenario.controller.name
        (0.01, 'vprnn')
    """
    assignments = assignments_of(blocks, settings)
    return load_scenario(scenario, controller=controller, assignments=assignments, seed=seed)
