"""`@compiled` and `@compiled(SIGNATURE)`."""

from time import perf_counter

import numpy as np
import pytest

from surgsim.compiled import watch

SHAPES = "from typing import NamedTuple\nclass Seen(NamedTuple):\n    q: object\n    J: object\n"
TYPED = """
from numba import types
from shapes import Seen
from surgsim.compiled import compiled

A = types.float64[::1]
SEEN = types.NamedTuple((A, types.float64[:, ::1]), Seen)
STEP = types.int64(SEEN, A)

@compiled(STEP)
def double(seen, out):
    for i in range(seen.q.size):
        out[i] = 2.0 * seen.q[i]
    return 0

@compiled(STEP)
def halve(seen, out):
    for i in range(seen.q.size):
        out[i] = 0.5 * seen.J[i, 0]
    return 1

@compiled(types.int64(types.FunctionType(STEP), SEEN, A))
def loop(step, seen, out):
    return step(seen, out)
"""


def test_kernels_of_a_signature_compile_at_import_and_pass_as_parameters(workshop, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    workshop.write(shapes=SHAPES, user=TYPED)
    for expected in (["double", "halve", "loop"], []):
        module = workshop.run("user")
        assert workshop.compiled == expected
        seen, out = module.Seen(np.array([1.0, 2.0]), np.array([[4.0], [6.0]])), np.zeros(2)
        assert module.loop(module.double, seen, out) == 0
        assert out.tolist() == [2.0, 4.0]
        assert module.loop(module.halve, seen, out) == 1
        assert out.tolist() == [2.0, 3.0]
        assert workshop.compiled == expected


def test_several_signatures_as_text_and_no_other_types(workshop):
    head = "from surgsim.compiled import compiled\n"
    workshop.write(
        user=head + "@compiled('float64(float64)', 'int64(int64)')\ndef twice(x):\n    return x + x\n"
    )
    module = workshop.run("user")
    assert workshop.compiled == ["twice", "twice"]
    assert (module.twice(1.5), module.twice(2)) == (3.0, 4)
    with pytest.raises(TypeError, match="No matching definition"):
        module.twice("ab")
    workshop.run("user")
    assert workshop.compiled == []


def test_clocks_of_a_run_leave_out_what_compiling_took(workshop):
    workshop.write(user="from surgsim.compiled import compiled\n@compiled\ndef twice(x):\n    return x + x\n")
    module = workshop.run("user")
    began, wall, thread = perf_counter(), watch.working_time(), watch.thread_time_ns()
    module.twice(1.0)
    took = perf_counter() - began
    assert watch.working_time() - wall < 0.5 * took
    assert 1e-9 * (watch.thread_time_ns() - thread) < 0.5 * took
