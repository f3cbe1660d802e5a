"""Short versions of the shipped scenarios, and environments on them."""

from collections.abc import Callable

import pytest

from surgsim.scenario.load import load_scenario, of_one_arm, shipped
from surgsim.scenario.schema import Scenario
from surgsim.tasks.base import PathTaskConfig

BRIEF = (
    "theatre=false",
    "task.duration_s=0.2",
    "task.ramp_s=0.1",
    "task.hold_start_s=0",
    "task.hold_end_s=0",
)


def brief(name: str) -> Scenario:
    """A shipped scenario with its path in 0.2 s."""
    whole = load_scenario(name)
    kept = [part.model_dump_json() for part in whole.disturbances if not part.begins_s]
    if not isinstance(whole.task, PathTaskConfig):
        return whole
    early = f"disturbances=[{', '.join(kept)}]"  # what begins after the end is refused
    return load_scenario(name, assignments=[*BRIEF, early])


@pytest.fixture(scope="session")
def brief_scenario() -> Callable[[str], Scenario]:
    return brief


def _is_second_twin(name: str) -> bool:
    """Whether the same scenario on the other arm is tested in its place, but for the circle."""
    return (
        name.endswith("_panda") and name != "circle_panda" and name.replace("panda", "lwr4plus") in shipped()
    )


@pytest.fixture(
    scope="session",
    params=[
        pytest.param(name, marks=pytest.mark.slow) if _is_second_twin(name) else name
        for name in of_one_arm(shipped())
    ],
)
def shipped_name(request) -> str:
    """Every shipped scenario."""
    return request.param
