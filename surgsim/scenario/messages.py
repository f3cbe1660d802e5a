"""Words for values and for what a config expects, always on one line."""

import enum
import types
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from surgsim.models.config import ForEachJoint

_NOUNS: dict[Any, tuple[str, str]] = {
    float: ("a number", "numbers"),
    int: ("an integer", "integers"),
    bool: ("true or false", "values true or false"),
    str: ("a string", "strings"),
}
_KINDS = ((bool, "a truth value"), (int | float, "a number"), (str, "a string"), (list, "a list"))
_BOUNDS = ("gt", "greater than"), ("ge", "at least"), ("lt", "less than"), ("le", "at most")


def one_line(text: str, limit: int = 60) -> str:
    """`text` shortened to `limit` characters, with line breaks and other unprintable characters escaped."""
    head = text[: limit + 1]
    safe = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in head)
    return safe if len(safe) <= limit else safe[: limit - 3] + "..."


def show(value: Any, limit: int = 60) -> str:
    """`value` as YAML would write it, on one line and shortened to `limit` characters."""
    return one_line(_flow(value, limit), limit)


def _flow(value: Any, limit: int) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return repr(value if len(value) <= limit else value[:limit])
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_flow(item, limit) for item in value[:limit]) + "]"
    if isinstance(value, dict):
        pairs = list(value.items())[:limit]
        return "{" + ", ".join(f"{key}: {_flow(item, limit)}" for key, item in pairs) + "}"
    return repr(value)


def show_with_kind(value: Any) -> str:
    """`value` and what it is, e.g. `'two' (a string)`."""
    if value is None:
        return "null (no value)"
    return f"{show(value)} ({next((name for kind, name in _KINDS if isinstance(value, kind)), 'a mapping')})"


def dotted(path: tuple[str | int, ...]) -> str:
    """Key path as a person writes it, e.g. `disturbances.0.mass_kg`."""
    return ".".join(one_line(str(key)) for key in path)


@dataclass(frozen=True, kw_only=True)
class Shape:
    """A type annotation without its wrappers.

    Attributes:
        core: The type itself; a `Union` has at least two members, none of them `None`.
        notes: What `Annotated` and the field say about it, outermost first.
        optional: Whether null is allowed too.
    """

    core: Any
    notes: tuple[Any, ...] = ()
    optional: bool = False

    @property
    def is_model(self) -> bool:
        """Whether it is a config class."""
        return isinstance(self.core, type) and issubclass(self.core, BaseModel)

    @property
    def is_union(self) -> bool:
        """Whether several types are possible."""
        return get_origin(self.core) in (Union, types.UnionType)

    @property
    def title(self) -> str | None:
        """What a person calls such a value; `Catalog.union` gives it."""
        return next((note.title for note in self.notes if isinstance(note, FieldInfo) and note.title), None)

    @property
    def tag(self) -> str | None:
        """Key that tells the members of a union apart."""
        found = (note.discriminator for note in self.notes if isinstance(note, FieldInfo))
        return next((key for key in found if isinstance(key, str)), None) if self.is_union else None

    def members(self) -> dict[str, "Shape"]:
        """Members of a union by the value of its tag."""
        shapes = [unwrap(member) for member in get_args(self.core)]
        return {str(name): shape for shape in shapes for name in shape.child(self.tag or "").choices()}

    def choices(self) -> tuple[Any, ...]:
        """Allowed values of a `Literal` or an enum; empty for other types."""
        if get_origin(self.core) is Literal:
            return get_args(self.core)
        if isinstance(self.core, type) and issubclass(self.core, enum.Enum):
            return tuple(member.value for member in self.core)
        return ()

    def fields(self) -> dict[str, FieldInfo]:
        """Fields of a config class by the key that YAML uses."""
        if not self.is_model:
            return {}
        return {field.alias or name: field for name, field in self.core.model_fields.items()}

    def child(self, key: str | int) -> "Shape":
        """Shape of the value under `key`; anything if the schema does not know the key."""
        args = get_args(self.core)
        if self.is_model and key in self.fields():
            field = self.fields()[str(key)]
            return unwrap(field.annotation, (field,))
        if self.is_fixed and isinstance(key, int):
            return unwrap(args[key] if key < len(args) else Any)
        if args and not self.is_union and not self.choices():
            return unwrap(args[1] if isinstance(key, str) and len(args) > 1 else args[0])
        return Shape(core=Any)

    @property
    def is_fixed(self) -> bool:
        """Whether it is a tuple with a fixed number of items."""
        return get_origin(self.core) is tuple and Ellipsis not in get_args(self.core)

    def bounds(self) -> str:
        """Bounds on a number, e.g. `greater than 0 and at most 1`; empty if there are none."""
        return " and ".join(f"{words} {value:g}" for words, value in self._bounds())

    def _bounds(self) -> Iterator[tuple[str, float]]:
        for note in self.notes:
            for part in note.metadata if isinstance(note, FieldInfo) else [note]:
                if isinstance(part, annotated_types.BaseMetadata):
                    yield from ((words, getattr(part, key)) for key, words in _BOUNDS if hasattr(part, key))

    def expected(self) -> str:
        """What must stand here, with an article, e.g. `a list of 3 numbers`."""
        text = f"{self.noun()} {self.bounds()}".strip()
        return f"{text} or null" if self.optional else text

    def noun(self) -> str:
        """What must stand here, without bounds."""
        if self.core in (float, int, bool, str):
            return _NOUNS[self.core][0]
        if self.choices():
            return "one of " + ", ".join(map(str, self.choices()))
        if self.is_union:
            return self._union_noun()
        if self.is_model:
            return f"a mapping with the keys {', '.join(self.fields())}"
        if get_origin(self.core) is dict or self.core is dict:
            return "a mapping"
        if get_origin(self.core) in (list, tuple) or self.core in (list, tuple):
            return self._list_noun()
        return "a value"

    def _union_noun(self) -> str:
        if self.tag:
            return f"a mapping with the key {self.tag}: {', '.join(sorted(self.members()))}"
        return " or ".join(dict.fromkeys(unwrap(member).expected() for member in get_args(self.core)))

    def _list_noun(self) -> str:
        args = get_args(self.core)
        item = self.child(0)
        plural = _NOUNS[item.core][1] if item.core in (float, int, bool, str) else "items"
        if item.title:
            plural = f"mappings, each a {item.title}"
        if any(isinstance(note, ForEachJoint) for note in self.notes):
            plural = f"{plural}, one for each joint"
        return f"a list of {len(args)} {plural}" if self.is_fixed else f"a list of {plural}"


def unwrap(annotation: Any, notes: tuple[Any, ...] = ()) -> Shape:
    """Strip `Annotated`, `Optional` and type aliases from `annotation`, keeping what they say."""
    optional = False
    while True:
        if get_origin(annotation) is Annotated:
            notes = (*notes, *annotation.__metadata__)
            annotation = annotation.__origin__
        elif hasattr(annotation, "__value__"):
            annotation = annotation.__value__
        elif get_origin(annotation) in (Union, types.UnionType) and type(None) in get_args(annotation):
            optional = True
            rest = tuple(member for member in get_args(annotation) if member is not type(None))
            annotation = Union[rest]  # noqa: UP007
        else:
            return Shape(core=annotation, notes=notes, optional=optional)
