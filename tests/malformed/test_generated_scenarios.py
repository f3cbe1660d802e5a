"""Every config that a scenario can hold, with each of its keys wrong in every way that its type allows.

The cases are made from the schema, so a new part or key is covered without further edits.
"""

import copy
import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import pytest

from surgsim.scenario.messages import Shape, dotted, unwrap
from surgsim.scenario.schema import Scenario
from surgsim.scenario.yaml_text import dump_yaml

Path = tuple[str | int, ...]

NAN, INFINITE, TWICE = "__nan__", "__infinite__", "__twice__"
BASE: dict[str, Any] = {
    "name": "made",
    "robot": {"name": "lwr4plus"},
    "trocar": {"position_m": [0.0, 0.55, 0.2]},
    "start": {"posture_rad": [1.57, -0.52, 0.0, 1.57, 0.0, -1.05, 0.0]},
    "task": {"type": "circle", "radius_m": 0.02, "start_m": [0.02, 0.55, 0.02], "duration_s": 10.0},
    "controller": {"name": "made", "resolver": {"type": "pinv"}, "torque_law": {"type": "joint_impedance"}},
    "disturbances": [],
}


@dataclass(frozen=True)
class Case:
    """A scenario with one thing wrong."""

    tree: dict[str, Any]
    path: Path
    kind: str
    hint: str = ""

    @property
    def id(self) -> str:
        return f"{dotted(self.path)}-{self.kind}"

    @property
    def text(self) -> str:
        text = (
            dump_yaml(self.tree).replace(f'"{NAN}"', ".nan").replace(NAN, ".nan").replace(INFINITE, "-.inf")
        )
        return re.sub(rf"(?m)^( *(?:- )?)(\w+){TWICE}:", r"\1\2:", text)


def _sample(shape: Shape) -> Any:
    """A value of the right type, inside the bounds."""
    if shape.choices():
        return shape.choices()[0]
    if shape.is_union:
        members = shape.members()
        return _sample(next(iter(members.values()))) if members else _sample(unwrap(shape.core.__args__[0]))
    if shape.is_model:
        required = {
            key: _sample(shape.child(key)) for key, field in shape.fields().items() if field.is_required()
        }
        return {**_tag(shape), **required}
    if shape.is_fixed:
        return [_sample(shape.child(i)) for i in range(len(shape.core.__args__))]
    if shape.core in (float, int):
        low, high = _bound(shape, "gt", "ge"), _bound(shape, "lt", "le")
        return shape.core((low + high) / 2 if None not in (low, high) else (low or 0) + 1)
    return {str: "text", bool: True}.get(shape.core, [_sample(shape.child(0))])


def _tag(shape: Shape) -> dict[str, Any]:
    choices = shape.child("type").choices() if "type" in shape.fields() else ()
    return {"type": choices[0]} if choices else {}


def _bound(shape: Shape, *keys: str) -> float | None:
    found = [
        getattr(part, key)
        for note in shape.notes
        for part in getattr(note, "metadata", [note])
        for key in keys
        if getattr(part, key, None) is not None
    ]
    return found[0] if found else None


def _models(shape: Shape, path: Path, tree: dict[str, Any]) -> Iterator[tuple[Shape, Path, dict[str, Any]]]:
    """Every config below `shape`, each with where it stands and a scenario that has it there."""
    if shape.is_union:
        for member in shape.members().values():
            yield from _models(member, path, _with(tree, path, _sample(member)))
    elif shape.is_model:
        here = _at(tree, path)
        if not isinstance(here, dict) or here.get("type", _tag(shape).get("type")) != _tag(shape).get("type"):
            tree = _with(tree, path, _sample(shape))
        yield shape, path, tree
        for key in shape.fields():
            yield from _models(shape.child(key), (*path, key), tree)
    elif not shape.is_fixed and getattr(shape.core, "__origin__", None) in (tuple, list):
        item = shape.child(0)
        if item.is_union or item.is_model:
            yield from _models(item, (*path, 0), tree)


def _at(tree: Any, path: Path) -> Any:
    for key in path:
        try:
            tree = tree[key]
        except (KeyError, IndexError, TypeError):
            return None
    return tree


def _with(tree: dict[str, Any], path: Path, value: Any) -> dict[str, Any]:
    """`tree` with `value` at `path`; what is missing on the way is made."""
    if not path:
        return value
    tree = copy.deepcopy(tree)
    node: Any = tree
    for key, after in itertools.pairwise(path):
        if isinstance(node, list):
            node.extend({} for _ in range(len(node), int(key) + 1))
        elif not isinstance(node.get(key), dict | list):
            node[key] = [] if isinstance(after, int) else {}
        node = node[key]
    if isinstance(node, list):
        node[path[-1] :] = [value]
    else:
        node[path[-1]] = value
    return tree


def _wrong_values(shape: Shape, turn: int) -> Iterator[tuple[str, Any]]:
    """What is no value of `shape`, by what is wrong with it; `turn` varies the kinds of type."""
    numeric = shape.core in (float, int)
    others = ["fast", True, [1.0], {"value": 1.0}] if numeric else [7, 7.5, True, {"value": 1.0}]
    if shape.core is bool:
        others = [1, "yes", "on", [True]]
    if shape.is_model or shape.is_union or shape.core is dict:
        others = [7, "on", [1.0], True]
    if shape.core is not Any:
        yield "type", others[turn % 4]
        if not shape.optional and turn % 2:
            yield "null", None
    if numeric:
        yield ("nan", NAN) if turn % 2 else ("infinite", INFINITE)
        for key, beyond in (("gt", 0.0), ("ge", -1.0), ("lt", 0.0), ("le", 1.0)):
            if (bound := _bound(shape, key)) is not None:
                yield f"not {key} {bound:g}", shape.core(bound + beyond)
    if shape.is_fixed:
        yield "short", _sample(shape)[:-1]
        yield "long", [*_sample(shape), 0.0]
        yield "hole", [None, *_sample(shape)[1:]]
        yield "nan inside", [*_sample(shape)[:-1], NAN]
    if shape.choices():
        yield "unknown", f"{shape.choices()[0]}x"


def _cases() -> Iterator[Case]:
    seen: set[Any] = set()
    for shape, path, tree in _models(unwrap(Scenario), (), BASE):
        if shape.core in seen:  # a resolver may hold another one
            continue
        seen.add(shape.core)
        label = _tag(shape).get("type", "")
        for case in (*_cases_of_keys(shape, path, tree), *_cases_of_names(shape, path, tree)):
            yield replace(case, kind=f"{label} {case.kind}".strip())


def _cases_of_keys(shape: Shape, path: Path, tree: dict[str, Any]) -> Iterator[Case]:
    for turn, key in enumerate(shape.fields()):
        for kind, value in _wrong_values(shape.child(key), turn):
            yield Case(_with(tree, (*path, key), value), (*path, key), kind)


def _cases_of_names(shape: Shape, path: Path, tree: dict[str, Any]) -> Iterator[Case]:
    for turn, (key, field) in enumerate(shape.fields().items()):
        inside = _at(tree, path)
        without = {name: value for name, value in inside.items() if name != key}
        if field.is_required() and len(inside) > 1:
            yield Case(_with(tree, path, without), (*path, key), "missing")
        misspelt = f"{key}q"
        if key != "type" and turn % 2 == 0 and misspelt not in shape.fields():
            value = inside.get(key, 1.0)
            changed = _with(tree, path, {**without, misspelt: value})
            yield Case(changed, (*path, misspelt), "misspelt", f"Did you mean '{key}'?")
        if key in inside:
            yield Case(
                _with(tree, path, {**inside, f"{key}{TWICE}": 1}), (*path, key), "twice", "duplicate key"
            )


CASES = list(_cases())


def test_there_are_enough() -> None:
    assert len(CASES) >= 200
    assert {"missing", "misspelt", "twice"} <= {case.kind.split()[-1] for case in CASES}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_every_key_of_every_config(case: Case, refused, tmp_path) -> None:
    file = tmp_path / "made.yaml"
    file.write_text(case.text)
    line = refused("check", "made.yaml")
    where = re.match(r"made\.yaml:(\d+): ([^:\s]+): (.+)", line)
    assert where, line
    assert where[2].startswith(dotted(case.path)), line
    assert case.hint in where[3]
    if case.kind.split()[-1] != "missing":
        assert str(case.path[-1]) in case.text.splitlines()[int(where[1]) - 1]
