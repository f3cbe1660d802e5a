"""Catalogs of parts: resolvers, torque laws, tasks, disturbances, plants.

A part is one file with a frozen config and the part itself; a catalog holds the name and the place of
each config, so that names can be listed without importing anything. Other packages add parts through
entry points of the catalog's group.
"""

import importlib
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import entry_points
from typing import Annotated, Any, Union

from pydantic import BaseModel, ConfigDict, Field

from surgsim.errors import SurgsimError, unknown_name


class PartConfig(BaseModel):
    """Base of every config: frozen, strict, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


@dataclass(frozen=True)
class Catalog:
    """Named config classes of one kind.

    Attributes:
        kind: What a person calls such a part, e.g. `resolver`.
        group: Entry-point group through which other packages add parts.
        places: Name to `module:Class` of the shipped configs.
    """

    kind: str
    group: str
    places: dict[str, str] = field(default_factory=dict)

    @cached_property
    def _all(self) -> dict[str, str]:
        added = {point.name: point.value for point in entry_points(group=self.group)}
        return {**added, **self.places}

    def names(self) -> list[str]:
        """Names of all parts, sorted."""
        return sorted(self._all)

    def config(self, name: str) -> type[PartConfig]:
        """Config class of the part `name`.

        Raises:
            SurgsimError: If there is none, or a foreign part does not load.
        """
        if name not in self._all:
            raise SurgsimError(unknown_name(name, self.kind, self._all))
        module, _, attribute = self._all[name].partition(":")
        try:
            found = getattr(importlib.import_module(module), attribute)
        except (ImportError, AttributeError) as error:
            raise SurgsimError(f"{self.kind} '{name}' does not load: {error}") from error
        if not (isinstance(found, type) and issubclass(found, PartConfig)):
            raise SurgsimError(f"{self.kind} '{name}' ({self._all[name]}) is not a PartConfig class")
        return found

    def summary(self, name: str) -> str:
        """First line of the part's docstring."""
        return (self.config(name).__doc__ or "").strip().split("\n")[0]

    def union(self) -> Any:
        """The pydantic type 'any part of this catalog', told apart by its `type` key and titled by kind."""
        classes = tuple(self.config(name) for name in self.names())
        if len(classes) == 1:
            return Annotated[classes[0], Field(title=self.kind)]
        return Annotated[Union[classes], Field(discriminator="type", title=self.kind)]  # noqa: UP007
