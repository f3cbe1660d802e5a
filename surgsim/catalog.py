"""Catalogs of parts: resolvers, torque laws, tasks, disturbances, plants.

A part is one file with a frozen config and the part itself; a catalog holds the name and the place of
each config, so that names can be listed without importing anything. Other packages add parts through
entry points of the catalog's group. One of those that does not load must not stop the rest: a stand-in takes
its place, which refuses every scenario that names it.
"""

import importlib
import multiprocessing
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Protocol, Self, Union, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, create_model, model_validator

from surgsim.errors import SurgsimError, told, unknown_name
from surgsim.plugins import Offer, offers


class Surroundings(Protocol):
    """What a part may ask of the scenario that names it."""

    @property
    def control_period_s(self) -> float:
        """Time between control ticks [s]."""
        ...

    @property
    def has_wall(self) -> bool:
        """Whether there is a physical wall around the trocar."""
        ...

    @property
    def has_force_sensor(self) -> bool:
        """Whether there is a force-torque sensor at the flange."""
        ...

    @property
    def has_drives(self) -> bool:
        """Whether the arm's joints have motors behind elastic gears."""
        ...

    @property
    def takes_joint_reference(self) -> bool:
        """Whether the arm's own impedance loop is commanded joint positions."""
        ...

    @property
    def rolls_instrument(self) -> bool:
        """Whether the task needs the instrument to be rolled."""
        ...

    @property
    def props(self) -> Sequence[object]:
        """Configs of the props."""
        ...


ADDED = "added"
"""Marks a key that came after hashes had been published: `key: Annotated[float | None, ADDED] = None`.

Its default leaves every run as it was before the key, and never changes: with it the key is in no hash.
"""


class PartConfig(BaseModel):
    """Base of every config: frozen, strict, unknown keys refused."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, defer_build=True
    )  # built at the first use: a scenario names a few of a hundred

    def check(self, scenario: Surroundings) -> None:
        """Refuse a scenario that the part does not fit.

        Raises:
            ValueError: With the reason.
        """

    def check_installed(self) -> None:
        """Refuse a part that is built with a package which is not installed.

        Raises:
            MissingPackageError: With the package.
        """

    def written_out(self, joints: int) -> Self:
        """The same part with the lists that null stands for, a number for each of the arm's `joints`."""
        return self


NAME = re.compile(r"[a-z0-9][a-z0-9_]{0,63}")
"""What is safe as a file's name."""


def check_name(name: str) -> str:
    """`name`, if it is safe as a file's.

    Raises:
        ValueError: If it is not.
    """
    if not NAME.fullmatch(name):
        raise ValueError(f"'{name}' must be lower-case letters, digits and underscores, at most 64")
    return name


Name = Annotated[str, AfterValidator(check_name)]
"""A name that is safe as a file's: of a scenario, a controller, a suite."""


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
    _stand_ins: dict[str, type[PartConfig]] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def _offers(self) -> dict[str, Offer]:
        return {name: offer for name, offer in offers(self.group).items() if name not in self.places}

    @cached_property
    def _all(self) -> dict[str, str]:
        return {**{name: offer.place for name, offer in self._offers.items()}, **self.places}

    def _called(self, name: str) -> str:
        """What messages call the part `name`, with the package that brings it."""
        foreign = self._offers.get(name)
        return f"{self.kind} '{name}'" + (f" {foreign.origin}" if foreign else "")

    def names(self) -> list[str]:
        """Names of all parts, sorted."""
        return sorted(self._all)

    def config(self, name: str) -> type[PartConfig]:
        """Config class of the part `name`.

        Raises:
            SurgsimError: If there is none, or it does not load.
        """
        if name not in self._all:
            raise SurgsimError(unknown_name(name, self.kind, self._all))
        module, _, attribute = self._all[name].partition(":")
        try:
            found = getattr(importlib.import_module(module), attribute)
        except Exception as error:
            if name in self.places and not isinstance(error, ImportError | AttributeError):
                raise  # a bug of ours
            raise SurgsimError(f"{self._called(name)} does not load: {told(error)}") from error
        if not (isinstance(found, type) and issubclass(found, PartConfig)):
            raise SurgsimError(f"{self._called(name)} ({self._all[name]}) is not a PartConfig class")
        return found

    def loaded(self, name: str) -> type[PartConfig]:
        """Config class of the part `name`, whose `type` is that name.

        Raises:
            SurgsimError: If there is none, it does not load, or its `type` is another.
        """
        return _checked(self.config(name), self._called(name), name)

    def usable(self, name: str) -> type[PartConfig]:
        """Config class of the part `name`, or a stand-in for a foreign one that does not load.

        The first time, standard error says what does not load.

        Raises:
            SurgsimError: If there is none, or one of ours does not load.
        """
        if name in self.places:
            return self.config(name)
        if name not in self._stand_ins:
            try:
                return self.loaded(name)
            except SurgsimError as error:
                self._stand_ins[name] = _stand_in(name, str(error))
                if multiprocessing.parent_process() is None:  # workers need not say it again
                    print(f"surgsim: {error}; no scenario can name it", file=sys.stderr)
        return self._stand_ins[name]

    def summary(self, name: str) -> str:
        """First line of the part's docstring, or why it does not load."""
        return (self.usable(name).__doc__ or "").strip().split("\n")[0]

    def union(self) -> Any:
        """The pydantic type 'any part of this catalog', told apart by its `type` key and titled by kind."""
        classes = tuple(self.usable(name) for name in self.names())
        if len(classes) == 1:
            return Annotated[classes[0], Field(title=self.kind)]
        return Annotated[Union[classes], Field(discriminator="type", title=self.kind)]  # noqa: UP007


def _checked(config: type[PartConfig], called: str, name: str) -> type[PartConfig]:
    """`config`, if its `type` is `name`: the union of a catalog's parts tells them apart by it."""
    key = config.model_fields.get("type")
    if key is None or get_args(key.annotation) != (name,):
        raise SurgsimError(f"{called} ({config.__qualname__}) needs the field type: Literal['{name}']")
    return config


class _DoesNotLoad(PartConfig):
    reason: ClassVar[str]

    @model_validator(mode="before")
    @classmethod
    def _refuse(cls, data: Any) -> Any:
        raise ValueError(cls.reason)


def _stand_in(name: str, reason: str) -> type[PartConfig]:
    """A config of the type `name` that refuses everything with `reason`."""
    key: Any = (Literal.__getitem__(name), name)
    config = create_model("DoesNotLoad", __base__=_DoesNotLoad, __doc__=f"{reason}.", type=key)
    config.reason = reason
    return config
