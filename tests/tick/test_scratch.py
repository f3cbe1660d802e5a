"""Arrays on the stack: large enough for every arm, and never handed back by the function that they are in."""

import ast
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import surgsim
from surgsim.compiled import compiled
from surgsim.tick.arrays import MOST_JOINTS, Array, Record
from surgsim.tick.overlay import overlay
from surgsim.tick.scratch import scratch, scratch_matrix

NAMES = {"scratch", "scratch_matrix"}
FUNCTIONS = [
    (path.name, node)
    for path in sorted(Path(surgsim.__file__).parent.rglob("*.py"))
    if path.name != "scratch.py"
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    if isinstance(node, ast.FunctionDef)
    if any(isinstance(n, ast.Call) and getattr(n.func, "id", "") in NAMES for n in ast.walk(node))
]


@compiled
def _sums(x, out):
    square, line = scratch_matrix(3, x.size), scratch(x.size)
    for j in range(x.size):
        line[j] = 0.0
        for i in range(3):
            square[i, j] = (i + 1) * x[j]
    for i in range(3):
        for j in range(x.size):
            line[j] += square[i, j]
    out[:] = line


def test_scratch_holds_what_is_written_in_compiled_code_and_in_python():
    x, out = np.arange(MOST_JOINTS, dtype=float), np.zeros(MOST_JOINTS)
    for form in (_sums, _sums.py_func):
        out[:] = 0.0
        form(x, out)
        np.testing.assert_array_equal(out, 6.0 * x)


@pytest.mark.parametrize(("file", "function"), FUNCTIONS, ids=lambda value: getattr(value, "name", value))
def test_no_function_returns_its_scratch(file, function):
    names = {
        name.id
        for made in ast.walk(function)
        if isinstance(made, ast.Assign) and NAMES & {getattr(n, "id", "") for n in ast.walk(made.value)}
        for name in ast.walk(made.targets[0])
        if isinstance(name, ast.Name)
    }
    returned = [node.value for node in ast.walk(function) if isinstance(node, ast.Return) and node.value]
    kept = [part for value in returned for part in (value.elts if isinstance(value, ast.Tuple) else [value])]
    assert names
    assert not names & {part.id for part in kept if isinstance(part, ast.Name)}
    assert not any(isinstance(part, ast.Subscript) and part.value.id in names for part in kept)


def test_functions_with_scratch_are_found():
    assert {"hierarchical_impedance", "nearest", "vprnn"} <= {function.name for _, function in FUNCTIONS}


@compiled
def _first(size, rows):
    return scratch(size).size + scratch_matrix(rows, 9).size


@pytest.mark.parametrize("size", [(41, 1), (1, 10)])
def test_more_than_there_is_room_for_is_refused(size):
    for form in (_first, _first.py_func):
        with pytest.raises(ValueError, match="at most"):
            form(*size)
    assert _first(40, 9) == 121


class Kept(Record):
    """A record with an array, as laws lay it over their memory."""

    SHAPES: ClassVar[dict[str, str]] = {"v": "3"}
    a: float
    v: Array


KEPT, KEPT_SIZE = overlay(Kept)


def keep(memory, x):
    kept, s = memory[:KEPT_SIZE].view(KEPT)[0], scratch(3)
    s[0] = x
    for i in range(3):
        kept.v[i] = x + i
    kept.a = s[0]


def test_a_kernel_with_scratch_keeps_what_it_writes_to_a_record_over_an_array():
    fast, slow = np.zeros(KEPT_SIZE), np.zeros(KEPT_SIZE)
    compiled(keep)(fast, 2.0)
    keep(slow, 2.0)
    assert fast.tolist() == slow.tolist() == [2.0, 2.0, 3.0, 4.0]
