"""An edit of anything that a kernel depends on compiles it again; any other edit does not."""

import numpy as np
import pytest

CALLED = "from surgsim.compiled import compiled\n@compiled\ndef called(x):\n    return x + 1.0\n"
CALLER = "from surgsim.compiled import compiled\n{}\n@compiled\ndef caller(x):\n    return {}\n"


def test_an_edit_of_a_called_kernel_in_another_file_is_never_missed(workshop):
    workshop.write(callee=CALLED, middle=CALLER.format("from callee import called", "2.0 * called(x)"))
    workshop.write(top=CALLER.format("from middle import caller as inner", "inner(x)"))
    assert workshop.run("callee", "middle", "top").caller(1.0) == 4.0
    assert workshop.run("callee", "middle", "top").caller(1.0) == 4.0
    assert workshop.compiled == []
    workshop.write(callee=CALLED.replace("1.0", "2.0"))
    assert workshop.run("callee", "middle", "top").caller(1.0) == 6.0
    assert set(workshop.compiled) == {"called", "caller"}


@pytest.mark.parametrize(
    ("imports", "expression", "old", "new"),
    [
        pytest.param("from values import V", "x + V", "V = 1.0", "V = 2.0", id="number"),
        pytest.param("import values", "x + values.V", "V = 1.0", "V = 2.0", id="number of a module"),
        pytest.param("from values import V", "x + V[1]", "V = (0, 1.0)", "V = (0, 2.0)", id="tuple"),
        pytest.param(
            "from values import V",
            "x + V[0]",
            "import numpy as np\nV = np.array([1.0])",
            "import numpy as np\nV = np.array([2.0])",
            id="array",
        ),
        pytest.param(
            "from values import V",
            "x + V.A.value",
            "from enum import IntEnum\nclass V(IntEnum):\n    A = 1",
            "from enum import IntEnum\nclass V(IntEnum):\n    A = 2",
            id="enum",
        ),
    ],
)
def test_an_edit_of_a_value_in_a_file_without_kernels_is_never_missed(
    workshop, imports, expression, old, new
):
    workshop.write(values=old, user=CALLER.format(imports, expression))
    assert workshop.run("values", "user").caller(1.0) == 2.0
    workshop.write(values=new)
    assert workshop.run("values", "user").caller(1.0) == 3.0
    assert workshop.compiled == ["caller"]


def test_the_order_of_a_named_tuples_fields_counts(workshop):
    seen = "from typing import NamedTuple\nclass Seen(NamedTuple):\n    {}: float\n    {}: float\n"
    workshop.write(seen=seen.format("a", "b"), user=CALLER.format("", "x.a"))
    assert workshop.run("seen", "user").caller(workshop.run("seen").Seen(1.0, 2.0)) == 1.0
    workshop.write(seen=seen.format("b", "a"))
    assert workshop.run("seen", "user").caller(workshop.run("seen").Seen(1.0, 2.0)) == 2.0


def test_a_kernel_made_by_a_function_depends_on_what_it_was_given(workshop):
    made = "from surgsim.compiled import compiled\ndef made(k):\n    @compiled\n    def f(x):\n"
    workshop.write(maker=made + "        return k * x\n    return f\n")
    assert [workshop.run("maker").made(k)(2.0) for k in (1.0, 2.0, 1.0)] == [2.0, 4.0, 2.0]
    assert workshop.compiled == []
    assert len(workshop.entries()) == 2


def test_an_edit_elsewhere_compiles_nothing(workshop):
    workshop.write(callee=CALLED, other="V = 1", user=CALLER.format("from callee import called", "called(x)"))
    workshop.run("callee", "user").caller(1.0)
    workshop.write(other="V = 2")
    workshop.run("other", "callee", "user").caller(1.0)
    assert workshop.compiled == []


def test_an_attribute_with_the_name_of_a_global_is_not_taken_for_it(workshop):
    lines = "import threading\nsize = threading.Lock()"
    workshop.write(user=CALLER.format(lines, "x.size"))
    for _ in range(2):
        assert workshop.run("user").caller(np.ones(2)) == 2
    assert workshop.compiled == []


def test_a_kernel_that_depends_on_what_cannot_be_hashed_is_not_kept(workshop):
    lines = "import threading\nlock = threading.Lock()"
    text = CALLER.format(lines, "x").replace("return x", "return x if x > 0.0 else g(x)")
    helper = "\n@compiled\ndef g(x):\n    return -x\nkeep = lock\n"
    workshop.write(user=text + helper)
    assert workshop.run("user").caller(1.0) == 1.0
    assert len(workshop.entries()) == 2  # the lock is in the file, but no kernel reads it
    workshop.write(user="import threading\n" + CALLED + "def hook(lock=threading.Lock()):\n    pass\n")
    module = workshop.run("user")
    module.called.py_func.__defaults__ = (module.hook.__defaults__[0],)
    module.called(1.0)
    assert len(workshop.entries()) == 2
