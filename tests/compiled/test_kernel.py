"""`@compiled`, and what Python and kernels call."""

from time import perf_counter

import numpy as np
import pytest

from surgsim.compiled import address_of, as_parameter, compiled, library, watch

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


def test_a_kernel_of_one_signature_takes_no_other_types(workshop):
    workshop.write(user=BY_ADDRESS)
    module = workshop.run("user")
    double = as_parameter(module.double, module.STEP)
    x, out = np.array([1.0, 2.0]), np.zeros(2)
    assert double(x, out) == 0
    assert out.tolist() == [2.0, 4.0]
    with pytest.raises(TypeError, match="No matching definition"):
        double(x, 3)


def test_a_function_that_numba_compiled_is_a_kernel_too(workshop):
    workshop.write(
        user=BY_ADDRESS.replace("@compiled\ndef double", "@njit\ndef double").replace(
            "types", "njit, types", 1
        )
    )
    module = workshop.run("user")
    x, out = np.array([1.0, 2.0]), np.zeros(2)
    assert module.loop(address_of(module.double, module.STEP), x, out) == 0
    assert out.tolist() == [2.0, 4.0]
    assert as_parameter(module.double, module.STEP)(out, x) == 0
    assert x.tolist() == [4.0, 8.0]


PLAIN = """
import numpy as np
from surgsim.compiled import compiled

@compiled
def scale(a, by, out):
    for i in range(a.size):
        out[i] = by * a[i]

@compiled
def both(record, other):
    scale(record.a, 2, record.b)
    scale(record.b, 3, other)
    scale(other, record.k, other)
"""


def test_one_compiled_kernel_serves_literals_numbers_fields_and_arrays(workshop):
    workshop.write(user=PLAIN)
    module = workshop.run("user")
    record = np.recarray((), [("a", "f8", 2), ("b", "f8", 2), ("k", "i8")])
    record.a, record.k, other = [1.0, 2.0], 5, np.zeros(2)
    module.both(np.asarray(record)[()], other)
    assert record.b.tolist() == [2.0, 4.0]
    assert other.tolist() == [30.0, 60.0]
    assert sorted(workshop.compiled) == ["both", "scale"]


BRANCHES = "\n".join(f"    if x > {k}: s += np.sin(s + {k}.0) * np.cos(x) / (1.0 + s * s)" for k in range(50))
LARGE = f"""
import numpy as np
from surgsim.compiled import compiled

@compiled
def large(x):
    s = 0.0
{BRANCHES}
    return s

@compiled
def twice(x):
    return 2.0 * large(x)

@compiled
def thrice(x):
    return 3.0 * large(x)
"""


def test_a_large_kernel_is_called_by_name_and_loaded_with_its_callers(workshop, monkeypatch):
    monkeypatch.setattr(library, "LARGEST_INLINED_BYTES", 3_500)
    workshop.write(user=LARGE)
    module = workshop.run("user")
    expected = 2.0 * module.large.py_func(30.5), 3.0 * module.large.py_func(30.5)
    assert (module.twice(30.5), module.thrice(30.5)) == expected
    for caller in (module.twice, module.thrice):
        (result,) = caller.within.overloads.values()
        (needed,) = result.library.needs
        assert "large" in needed.entry
        assert all("large" not in symbol for symbol in result.library.symbols)
    module = workshop.run("user")
    assert (module.twice(30.5), module.thrice(30.5)) == expected
    assert workshop.compiled == []


def test_a_caller_is_compiled_again_where_what_it_calls_by_name_is_gone(workshop, monkeypatch):
    monkeypatch.setattr(library, "LARGEST_INLINED_BYTES", 3_500)
    workshop.write(user=LARGE)
    expected = workshop.run("user").twice(30.5)
    (entry,) = [path for path in workshop.entries() if "large" in path.name]
    entry.unlink()
    assert workshop.run("user").twice(30.5) == expected
    assert "large" in workshop.compiled
    assert workshop.run("user").twice(30.5) == expected
    assert workshop.compiled == []


def test_the_same_function_again_in_one_process_is_not_compiled_again(workshop):
    workshop.write(user=BY_ADDRESS)
    module = workshop.run("user")
    x, out = np.array([1.0, 2.0]), np.zeros(2)
    for _ in range(2):
        assert compiled(module.double.py_func)(x, out) == 0
        assert out.tolist() == [2.0, 4.0]
    assert workshop.compiled == ["double"]


MAKER = """
from surgsim.compiled import compiled

def adding(number):
    @compiled
    def add(x):
        return x + number
    return add

@compiled
def one_more(x):
    return one(x)

@compiled
def two_more(x):
    return two(x)

one, two = adding(1.0), adding(2.0)
"""


@pytest.mark.parametrize("inlined", [12_000, 0], ids=["inlined", "by name"])
def test_functions_of_one_maker_that_different_processes_compiled_stay_apart(workshop, inlined, monkeypatch):
    monkeypatch.setattr(library, "LARGEST_INLINED_BYTES", inlined)
    workshop.write(user=MAKER)
    for name, expected in (("one_more", 11.0), ("two_more", 12.0)):  # each first in its process
        out = workshop.process(f"import user; print(user.{name}(10.0))", inlined)
        assert float(out) == expected
    module = workshop.run("user")
    assert (module.one_more(10.0), module.two_more(10.0)) == (11.0, 12.0)
    assert (module.one(10.0), module.two(10.0)) == (11.0, 12.0)
    assert "one_more" not in workshop.compiled
    assert "two_more" not in workshop.compiled


def test_clocks_of_a_run_leave_out_what_compiling_took(workshop):
    workshop.write(user="from surgsim.compiled import compiled\n@compiled\ndef twice(x):\n    return x + x\n")
    module = workshop.run("user")
    began, wall, thread = perf_counter(), watch.working_time(), watch.thread_time_ns()
    module.twice(1.0)
    took = perf_counter() - began
    assert watch.working_time() - wall < 0.5 * took
    assert 1e-9 * (watch.thread_time_ns() - thread) < 0.5 * took


RECORDS = """
import numpy as np
from surgsim.compiled import compiled

KIND = np.dtype([("a", float), ("b", float)], align=True)

@compiled
def inner(record):
    return record.a + 2.0 * record.b

@compiled
def outer(record):
    return inner(record) + 1.0

record = np.array([(1.0, 3.0)], dtype=KIND).view(np.recarray)[0]
"""
OTHERS = """
import numpy as np
from numba import from_dtype, typeof
kinds = [from_dtype(np.dtype([(name, float)], align=True)) for name in "pqrstuvw"]
print([kind._code for kind in kinds][:0] or "", end="")
import user
print(user.inner(user.record))
"""


def test_a_callee_that_another_process_compiled_again_costs_no_process_its_life(workshop):
    """The numbers of its types, and so its symbol, are others than those that its caller holds."""
    workshop.write(user=RECORDS)
    assert float(workshop.process("import user; print(user.outer(user.record))", 0)) == 8.0
    (gone,) = [path for path in workshop.entries() if "inner" in path.name]
    gone.unlink()
    assert float(workshop.process(OTHERS, 0)) == 7.0
    assert gone.exists()
    assert float(workshop.process("import user; print(user.outer(user.record))", 0)) == 8.0


ASSIGNING = """
import numpy as np
from numba import njit
from surgsim.compiled import compiled

@compiled
def ours(out, values):
    out[:] = values

@njit
def theirs(out, values):
    out[:] = values
"""


def test_an_array_of_another_size_is_refused_shortly_in_kernels_alone(workshop):
    workshop.write(user=ASSIGNING)
    user = workshop.run("user")
    out = np.zeros(3)
    user.ours(out, np.ones(3))
    np.testing.assert_array_equal(out, np.ones(3))
    with pytest.raises(ValueError, match="cannot assign an array to a slice of another size"):
        user.ours(out, np.ones(2))
    with pytest.raises(ValueError, match=r"slice of shape \(3,\) from input of shape \(2,\)"):
        user.theirs(out, np.ones(2))
