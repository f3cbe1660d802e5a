"""An axis of a suite: a named quantity, its levels, and the keys of the scenario that each level sets."""

import itertools
import json
from collections.abc import Sequence
from typing import Annotated, Any, Self

from pydantic import Field, FiniteFloat, field_validator, model_validator

from surgsim.catalog import PartConfig

Values = Annotated[tuple[Any, ...], Field(min_length=1)]


class AxisConfig(PartConfig):
    """A quantity that a suite varies.

    A level sets `settings` first, then `key` to the level, then `values` and the running controller's of
    `controllers` to their entry at the level's place.

    Attributes:
        label: What figures call it, with its unit in brackets.
        levels: Its levels, rising.
        key: Key path that takes the level itself; null: none does.
        values: Key paths with one value for each level.
        controllers: The same for one controller alone, by the name that the suite gives it.
        settings: `key.path=value` settings of all its levels.
    """

    label: str = ""
    levels: Annotated[tuple[FiniteFloat, ...], Field(min_length=1)]
    key: str | None = None
    values: dict[str, Values] = Field(default_factory=dict)
    controllers: dict[str, dict[str, Values]] = Field(default_factory=dict)
    settings: tuple[str, ...] = ()

    @field_validator("levels")
    @classmethod
    def _rise(cls, levels: tuple[float, ...]) -> tuple[float, ...]:
        if any(b <= a for a, b in itertools.pairwise(levels)):
            raise ValueError("levels must rise, each above the one before")
        return levels

    @model_validator(mode="after")
    def _whole(self) -> Self:
        """Every level has a value for every key, and sets something."""
        groups = [self.values, *self.controllers.values()]
        for key, values in (pair for group in groups for pair in group.items()):
            if len(values) != len(self.levels):
                raise ValueError(f"{key} has {len(values)} values for {len(self.levels)} levels")
        if self.key is None and not any(groups):
            raise ValueError("an axis needs key, values or controllers: its levels set nothing")
        if any(key.strip() == "seed" for key in self.touched_keys()):
            raise ValueError("seed cannot be on an axis: the seeds of a suite are its key seeds")
        return self

    def touched_keys(self) -> list[str]:
        """Every key path that a level sets, for any controller."""
        keys = [key for group in (self.values, *self.controllers.values()) for key in group]
        keys += [setting.partition("=")[0] for setting in self.settings]
        return [*keys, self.key] if self.key is not None else keys

    def sets_nothing_for(self, used: Sequence[str | None]) -> list[str]:
        """Controllers for which no level changes anything."""
        if self.key is not None or self.values:
            return []
        return [str(one) for one in used if one not in self.controllers]

    def assignments(self, place: int, controller: str | None) -> tuple[str, ...]:
        """`key.path=value` settings of the level at `place` for the controller that the suite calls so."""
        values = {**self.values, **self.controllers.get(controller or "", {})}
        own = {} if self.key is None else {self.key: self.levels[place]}
        chosen = {**own, **{key: column[place] for key, column in values.items()}}
        return (*self.settings, *(f"{key}={json.dumps(value)}" for key, value in chosen.items()))
