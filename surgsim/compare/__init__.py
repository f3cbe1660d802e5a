"""Batch comparisons: suites of runs, the engine that runs them, the table of their results.

`surgsim.compare` is this folder and the Python interface's function at once: the folder can be called, and
passes the call on to `surgsim.api.comparing.compare`.
"""

import importlib
import inspect
import sys
from types import ModuleType
from typing import Any


class _CallableFolder(ModuleType):
    """A module that can be called: a plain function of its name would be hidden by the folder's import."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return _function()(*arguments, **options)

    @property
    def __signature__(self) -> inspect.Signature:
        """What `help` and editors show."""
        return inspect.signature(_function())


def _function() -> Any:
    return importlib.import_module("surgsim.api.comparing").compare


sys.modules[__name__].__class__ = _CallableFolder
