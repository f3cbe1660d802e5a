"""The made-up results directory of `tests/compare`."""

import importlib.util
from pathlib import Path

import pytest

_FILE = Path(__file__).parents[1] / "compare" / "conftest.py"
_SPEC = importlib.util.spec_from_file_location("surgsim_made_results", _FILE)
_MODULE = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_MODULE)

made_results = _MODULE.made_results


@pytest.fixture
def made_up():
    """Functions that make results directories."""
    return _MODULE
