"""The flat public interface: what it holds, that it is lazy, that every name has an example that runs."""

import ast
import doctest
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import surgsim

FUNCTIONS = ("available", "compare", "load", "read", "run")
CLASSES = ("Comparison", "Run", "Scenario", "SurgsimError", "Trace")


def fresh(code: str) -> str:
    """Standard output of a new interpreter."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_public_names_are_these_and_each_is_found():
    assert sorted(surgsim.__all__) == sorted([*FUNCTIONS, *CLASSES])
    assert set(surgsim.__all__) <= set(dir(surgsim))
    for name in surgsim.__all__:
        assert getattr(surgsim, name) is getattr(surgsim, name)
    assert len(dir(surgsim)) == len(set(dir(surgsim))), "a name is listed twice once it was used"


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'surgsim' has no attribute 'runn'"):
        surgsim.runn  # noqa: B018


def test_the_import_loads_nothing_but_the_standard_library():
    code = "import sys; old = set(sys.modules); import surgsim; print(*(set(sys.modules) - old))"
    loaded = {name.partition(".")[0] for name in fresh(code).split()}
    assert loaded - set(sys.stdlib_module_names) == {"surgsim"}


def test_type_checkers_and_the_interpreter_are_told_the_same_names():
    tree = ast.parse(Path(surgsim.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    told = {alias.name: node.module for node in block.body for alias in node.names}
    assert sorted(told) == sorted(surgsim.__all__)
    for name, module in told.items():
        found = getattr(sys.modules.get(module) or __import__(module, fromlist=[name]), name)
        assert name == "compare" or found is getattr(surgsim, name)


@pytest.mark.parametrize("first", ["", "import surgsim.compare.engine; "])
def test_compare_can_be_called_whether_or_not_its_folder_was_imported_before(first):
    code = f"{first}import surgsim; surgsim.compare([])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stderr.strip().endswith("SurgsimError: give a suite, or scenarios; the list is empty")


def test_help_of_compare_shows_its_options():
    assert {"controllers", "seeds", "out", "resume"} <= set(inspect.signature(surgsim.compare).parameters)


def test_what_can_be_named_is_listed_and_a_wrong_kind_refused():
    assert {"pinv", "qp"} <= set(surgsim.available("controllers"))
    with pytest.raises(
        surgsim.SurgsimError, match=r"'robot' is not a kind of thing to list. Known.*'robots'"
    ):
        surgsim.available("robot")


def examples() -> list[doctest.DocTest]:
    """The examples of everything public."""
    from surgsim.api import comparing, leaderboard, metrics
    from surgsim.scenario import plain

    finder = doctest.DocTestFinder(exclude_empty=True, recurse=True)
    objects = [getattr(surgsim, name) for name in surgsim.__all__ if name != "compare"]
    objects += [comparing.compare, metrics.Metrics, leaderboard.Leaderboard, plain.assignments_of]
    found = [test for item in objects for test in finder.find(item, module=False)]
    of_package = doctest.DocTestFinder(recurse=False).find(surgsim, module=False, globs={})
    return [*found, *of_package]


EXAMPLES = {test.name: test for test in examples() if test.examples}


def test_every_public_class_and_function_has_an_example():
    public = {getattr(surgsim, name).__name__ for name in surgsim.__all__ if name != "compare"}
    assert public | {"compare"} <= set(EXAMPLES)


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_example_in_its_docstring_runs(name, capsys):
    example = EXAMPLES[name]
    failed, tried = doctest.DocTestRunner().run(example, clear_globs=False)
    assert tried
    assert not failed, capsys.readouterr().out
