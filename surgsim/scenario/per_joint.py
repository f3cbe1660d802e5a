"""Lists of a scenario that have one item for each joint of its robot."""

from collections.abc import Iterator, Sequence
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from surgsim.errors import SurgsimError
from surgsim.models.config import ForEachJoint, RobotConfig
from surgsim.models.robot import robot_joints
from surgsim.scenario.messages import show, unwrap
from surgsim.scenario.yaml_events import KeyPath


def check_lists(config: BaseModel, robot: RobotConfig) -> None:
    """Refuse a list that has not one item for each joint of `robot`.

    Raises:
        PydanticCustomError: For the first one; its context has the list's place in `config` as `at`.
    """
    try:
        n = robot_joints(robot)
    except SurgsimError as error:
        raise PydanticCustomError("placed", "{text}", {"text": str(error), "at": ("robot",)}) from error
    for path, values in _lists(config):
        if len(values) != n:
            count = f"{len(values)} item{'' if len(values) == 1 else 's'}"
            has = f"{show(list(values))} has {count}; robot '{robot.label}' has {n} joints"
            text = f"{has}. Expected {n} numbers."
            raise PydanticCustomError("placed", "{text}", {"text": text, "at": path})


def _lists(config: BaseModel, path: KeyPath = ()) -> Iterator[tuple[KeyPath, Sequence[Any]]]:
    """Every list of that kind, and its place."""
    for name, field in type(config).model_fields.items():
        value, here = getattr(config, name), (*path, field.alias or name)
        if isinstance(value, BaseModel):
            yield from _lists(value, here)
        elif isinstance(value, tuple) and _is_per_joint(field):
            yield here, value
        elif isinstance(value, tuple):
            for i, item in enumerate(value):
                if isinstance(item, BaseModel):
                    yield from _lists(item, (*here, i))


def _is_per_joint(field: FieldInfo) -> bool:
    notes = (*unwrap(field.annotation).notes, *field.metadata)
    return any(isinstance(note, ForEachJoint) for note in notes)
