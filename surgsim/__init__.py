"""Benchmark for controllers that move an instrument through a trocar, on MuJoCo.

The names below are the whole Python interface. Each is imported when it is first used, so `import surgsim`
loads nothing else.

Example:
    >>> import surgsim
    >>> run = surgsim.run("circle_lwr4plus", task={"duration_s": 2.0})
    >>> run.outcome
    'completed'
"""

import importlib

TYPE_CHECKING = False  # type checkers take it for true; the module `typing` takes a while to import
if TYPE_CHECKING:
    from surgsim.api.available import available
    from surgsim.api.comparing import compare
    from surgsim.api.comparison import Comparison
    from surgsim.api.loading import load
    from surgsim.api.reading import read
    from surgsim.api.run import Run
    from surgsim.api.running import run
    from surgsim.errors import SurgsimError
    from surgsim.scenario.schema import Scenario
    from surgsim.trace.trace import Trace

__version__ = "0.1.0"

__all__ = [
    "Comparison",
    "Run",
    "Scenario",
    "SurgsimError",
    "Trace",
    "available",
    "compare",
    "load",
    "read",
    "run",
]

_PLACES = {
    "Comparison": "surgsim.api.comparison",
    "Run": "surgsim.api.run",
    "Scenario": "surgsim.scenario.schema",
    "SurgsimError": "surgsim.errors",
    "Trace": "surgsim.trace.trace",
    "available": "surgsim.api.available",
    "compare": "surgsim.compare",  # the folder itself, which can be called
    "load": "surgsim.api.loading",
    "read": "surgsim.api.reading",
    "run": "surgsim.api.running",
}


if not TYPE_CHECKING:  # to a type checker it would mean that there is every name

    def __getattr__(name: str) -> object:
        """A public name, imported at its first use (PEP 562)."""
        if name not in _PLACES:
            raise AttributeError(f"module 'surgsim' has no attribute {name!r}")
        module = importlib.import_module(_PLACES[name])
        found = module if name == "compare" else getattr(module, name)
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted({*globals(), *_PLACES})
