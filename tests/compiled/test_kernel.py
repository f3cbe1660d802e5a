"""`@compiled` and `@compiled(SIGNATURE)`."""

from time import perf_counter

import numpy as np
import pytest

from surgsim.compiled import address_of, watch

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


BY_ADDRESS = """
from numba import types
from surgsim.compiled import call_at, compiled

A = types.float64[::1]
STEP = types.int64(A, A)

@compiled
def double(x, out):
    out[:] = 2.0 * x
    return 0

@compiled
def refuse(x, out):
    if x[0] < 0.0:
        raise ValueError("negative")
    return 7

@compiled
def loop(address, x, out):
    return call_at(address, x, out)
"""


def test_a_kernel_is_called_by_its_address(workshop):
    workshop.write(user=BY_ADDRESS)
    for _ in range(2):
        module = workshop.run("user")
        x, out = np.array([1.0, 2.0]), np.zeros(2)
        assert module.loop(address_of(module.double, module.STEP), x, out) == 0
        assert out.tolist() == [2.0, 4.0]
        refuse = address_of(module.refuse, module.STEP)
        assert module.loop(refuse, x, out) == 7
        with pytest.raises(ValueError, match=r"^negative$"):
            module.loop(refuse, -x, out)
    assert workshop.compiled == []


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
