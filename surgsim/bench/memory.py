"""Memory of a process that runs, and what a hundred runs leave in it."""

import sys
from pathlib import Path
from typing import Any

from surgsim.bench.children import in_child

Row = dict[str, Any]

_WARM_UP, _RUNS = 10, 100


def measure_memory(case: str, settings: tuple[str, ...] = ()) -> list[Row]:
    """Rows with the largest resident memory [MB]; None where the system does not tell.

    Args:
        case: Name of the case.
        settings: Values instead of the scenario's.
    """
    found = in_child("surgsim.bench.memory:grow", case, list(settings))
    names = {
        "imported": "before the first run",
        "one run": "after a run to its end with its metrics",
        "growth": f"added by {_RUNS} more runs of 0.2 s, after {_WARM_UP}",
    }
    return [{"moment": key, "peak_mb": found[key], "meaning": text} for key, text in names.items()]


def grow(name: str, settings: list[str]) -> dict[str, float | None]:
    """In a fresh process: its peaks [MB]."""
    from surgsim.bench.cases import chosen
    from surgsim.runs.folder import execute
    from surgsim.simulate.loop import Simulation
    from surgsim.simulate.setup import prepare

    imported = _peak_mb()
    case = chosen([name])[0]
    execute(case.scenario(*settings))
    one = _peak_mb()
    short = case.scenario(*settings)
    first = None
    for k in range(_WARM_UP + _RUNS):
        if k == _WARM_UP:
            first = _peak_mb()
        Simulation(prepare(short)).advance(200)
    last = _peak_mb()
    growth = None if first is None or last is None else last - first
    return {"imported": imported, "one run": one, "growth": growth}


def _peak_mb() -> float | None:
    """The process's own peak; on Linux `ru_maxrss` holds that of the process that started it, too."""
    status = Path("/proc/self/status")
    if status.exists():
        lines = status.read_text(encoding="utf-8").splitlines()
        peak = next((line.split()[1] for line in lines if line.startswith("VmHWM:")), None)
        return None if peak is None else 1024.0 * int(peak) / 1e6
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 1.0 if sys.platform == "darwin" else 1024.0
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
