"""Checks a parsed document against a config class and words the first problem for a person.

Pydantic validates the tree as strict JSON, so a list may become a tuple but '1' is no number and 1 is no
boolean. Its errors are then located in the document and the schema, and worded here.
"""

import difflib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, TypeVar

from pydantic import ValidationError

from surgsim.catalog import PartConfig
from surgsim.errors import ScenarioError, unknown_name
from surgsim.scenario.magnitudes import check_magnitudes
from surgsim.scenario.messages import Shape, one_line, show, show_with_kind, unwrap
from surgsim.scenario.yaml_events import KeyPath
from surgsim.scenario.yaml_text import YamlDocument

M = TypeVar("M", bound=PartConfig)

_ABSENT = object()
_MOST_WORDED = 100
_LONGEST = 400
_TYPE_CODES = ("int_from_float", "too_short", "too_long", "literal_error", "missing", "extra_forbidden")
_SUBJECTS = ("Input", "String", "List", "Tuple", "Value", "Dictionary", "Set", "Data")


@dataclass(frozen=True, kw_only=True)
class Problem:
    """One pydantic error, located.

    Attributes:
        path: Keys from the top of the document.
        code: Pydantic's error type.
        shape: What the schema says about the value.
        parent: What the schema says about the mapping or list that holds it.
        value: The value in the document, or `_ABSENT`.
        holder: The mapping or list in the document that holds it.
        message: Pydantic's message.
        context: Pydantic's details.
    """

    path: KeyPath
    code: str
    shape: Shape
    parent: Shape
    value: Any
    holder: Any
    message: str
    context: Mapping[str, Any]


def validate(model: type[M], document: YamlDocument) -> M:
    """Check `document` against `model`.

    Raises:
        ScenarioError: For the top-most problem, with the number of further ones.
    """
    check_magnitudes(document)
    try:
        return model.model_validate_json(json.dumps(document.tree), strict=True)
    except ValidationError as error:
        problems = list(_problems(model, document, error))
        first = problems[0]
        rest = len(problems) - 1
        more = f" (and {rest} more problem{'s' if rest > 1 else ''})" if rest else ""
        raise ScenarioError(document.where(first.path), _word(first) + more) from error


def _problems(model: type[M], document: YamlDocument, error: ValidationError) -> Iterator[Problem]:
    """All problems in document order, with those left out that follow from another."""
    rank = {path: index for index, path in enumerate(_paths(document.tree))}
    found: dict[tuple[KeyPath, str], Problem] = {}
    for item in error.errors(include_url=False, include_input=False):
        problem = _locate(model, document.tree, item)
        if _is_long_enough(problem):  # its items are at fault, and are problems of their own
            continue
        slot = (problem.path, "" if problem.shape.is_union else problem.code)
        if slot not in found or _is_type_code(found[slot].code):
            found[slot] = problem
    ordered = sorted(found.values(), key=lambda problem: _rank(rank, problem.path))
    unknown = (problem for problem in ordered if problem.code == "extra_forbidden")
    renamed = {(*problem.path[:-1], _meant(problem)) for problem in islice(unknown, _MOST_WORDED)}
    yield from (item for item in ordered if not (item.code == "missing" and item.path in renamed))


def _is_long_enough(problem: Problem) -> bool:
    """Whether a list is called too short that is not: pydantic counts the valid items alone."""
    least = problem.context.get("min_length", 0)
    return problem.code == "too_short" and isinstance(problem.value, list) and 0 < least <= len(problem.value)


def _paths(tree: Any, path: KeyPath = ()) -> Iterator[KeyPath]:
    yield path
    pairs: Iterable[tuple[str | int, Any]] = ()
    if isinstance(tree, dict):
        pairs = tree.items()
    elif isinstance(tree, list):
        pairs = enumerate(tree)
    for key, value in pairs:
        yield from _paths(value, (*path, key))


def _rank(rank: Mapping[KeyPath, int], path: KeyPath) -> int:
    while path not in rank:
        path = path[:-1]
    return rank[path]


def _locate(model: type[M], tree: Any, item: Mapping[str, Any]) -> Problem:
    """Follow pydantic's location through schema and document, leaving out its union tags."""
    shape, parent, value, holder = unwrap(model), Shape(core=Any), tree, None
    path: list[str | int] = []
    code: str = item["type"]
    if "at" in item.get("ctx", {}):  # a check of the whole that knows the key it is about
        return _placed(model, tree, item)
    for index, key in enumerate(item["loc"], start=1):
        if shape.tag and key in shape.members():
            shape = replace(shape.members()[str(key)], notes=shape.notes)
            continue
        if shape.is_union:
            code = "union_type" if _is_type_code(code) else code
            break  # its members have no names that a person would know
        if isinstance(key, int) and code == "missing" and index == len(item["loc"]):
            code = "too_short"  # an item of a tuple
            break
        if key == "[key]" or (isinstance(key, str) and key.startswith("function-")):
            continue
        parent, shape, holder, value = shape, shape.child(key), value, _get(value, key)
        path.append(key)
    if code in ("union_tag_invalid", "union_tag_not_found") and isinstance(value, dict):
        path.append(shape.tag or "type")
        parent, holder, value = shape, value, _get(value, path[-1])
        code = "missing" if value is _ABSENT else "union_tag_invalid"
    return Problem(
        path=tuple(path),
        code=code,
        shape=shape,
        parent=parent,
        value=value,
        holder=holder,
        message=item["msg"],
        context=item.get("ctx", {}),
    )


def _placed(model: type[PartConfig], tree: Any, item: Mapping[str, Any]) -> Problem:
    """The problem of a check that says its place and its words itself."""
    shape = unwrap(model)
    return Problem(
        path=(*item["loc"], *item["ctx"]["at"]),
        code=item["type"],
        shape=shape,
        parent=shape,
        value=tree,
        holder=tree,
        message=item["msg"],
        context=item["ctx"],
    )


def _get(value: Any, key: str | int) -> Any:
    if isinstance(value, dict):
        return value.get(str(key), _ABSENT)
    inside = isinstance(value, list) and isinstance(key, int) and key < len(value)
    return value[key] if inside else _ABSENT


def _is_type_code(code: str) -> bool:
    return code.endswith(("_type", "_parsing")) or code in _TYPE_CODES


def _word(problem: Problem) -> str:
    """The problem as one sentence or two."""
    match problem.code:
        case "extra_forbidden":
            return _unknown_key(problem)
        case "missing":
            return _missing(problem)
        case "union_tag_invalid":
            return _not_a(problem, list(problem.parent.members()))
        case "literal_error" | "enum" if problem.shape.choices():
            return _not_a(problem, list(problem.shape.choices()))
        case "value_error" | "assertion_error" if "error" in problem.context:
            return one_line(" ".join(str(problem.context["error"]).split()), _LONGEST)
        case "placed":
            return problem.message
        case "too_short" | "too_long" if isinstance(problem.value, list):
            return _wrong_length(problem)
    if problem.code.endswith(("_type", "_parsing")) or problem.code == "int_from_float":
        return _wrong_type(problem)
    return f"{_shown(problem)} is not allowed: {_rule(problem.message)}"


def _shown(problem: Problem) -> str:
    return "the default" if problem.value is _ABSENT else show(problem.value)


def _rule(message: str) -> str:
    """Pydantic's message as what must be."""
    subject, should, rest = message.partition(" should ")
    text = f"must {rest}" if should and subject in _SUBJECTS else message
    return one_line(" ".join(text.split()), _LONGEST)


def _near(name: Any, names: Iterable[Any], cutoff: float = 0.6) -> str | None:
    close = difflib.get_close_matches(str(name)[:80], [str(item) for item in names], n=1, cutoff=cutoff)
    return close[0] if close else None


def _meant(problem: Problem) -> str | None:
    """Key of the schema that an unknown key was probably meant to be."""
    free = [key for key in problem.parent.fields() if key not in problem.holder]
    return _near(problem.path[-1], free)


def _unknown_key(problem: Problem) -> str:
    meant = _meant(problem) or _near(problem.path[-1], problem.parent.fields())
    hint = f" Did you mean '{meant}'?" if meant else ""
    allowed = ", ".join(problem.parent.fields()) or "none"
    return f"unknown key (value {_shown(problem)}). Allowed: {allowed}.{hint}"


def _missing(problem: Problem) -> str:
    if problem.parent.is_union:
        expected = "one of " + ", ".join(sorted(problem.parent.members()))
        near = _near(problem.path[-1], problem.holder)
        return f"missing. Expected {expected}." + (f" Is '{near}' meant to be it?" if near else "")
    return f"missing. Expected {problem.shape.expected()}."


def _not_a(problem: Problem, names: list[Any]) -> str:
    """A value that is none of the allowed ones."""
    if not isinstance(problem.value, str):
        known = ", ".join(sorted(map(show, names)) if problem.shape.is_union else map(show, names))
        return f"{show_with_kind(problem.value)} is not allowed. Allowed: {known}."
    value = show(problem.value)[1:-1]
    if problem.path[-1:] == ("type",):
        return unknown_name(value, problem.parent.title or "known type", map(str, names))
    if problem.value in map(str, names):
        allowed = ", ".join(map(str, names))
        return f"{show_with_kind(problem.value)} is not allowed. Allowed: {allowed}, unquoted."
    near = _near(problem.value, names)
    hint = f" Did you mean '{near}'?" if near else ""
    return f"'{value}' is not allowed. Allowed: {', '.join(map(str, names))}.{hint}"


def _wrong_length(problem: Problem) -> str:
    count = len(problem.value)
    least, most = problem.context.get("min_length"), problem.context.get("max_length")
    bound = f"at least {least}" if least is not None else f"at most {most}"
    rule = problem.shape.expected() if problem.shape.is_fixed else f"{bound} items"
    return f"{show(problem.value)} has {count} item{'' if count == 1 else 's'}. Expected {rule}."


def _wrong_type(problem: Problem) -> str:
    shape, value = problem.shape, problem.value
    if value is _ABSENT:
        return f"the default is not allowed: {_rule(problem.message)}"
    text = f"{show_with_kind(value)} is not {shape.noun()}{' or null' if shape.optional else ''}"
    if shape.tag and value in list(shape.members()):
        return f"{text}. Did you mean {{{shape.tag}: {value}}}?"
    return text
