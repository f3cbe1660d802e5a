"""What starting costs, in CPU seconds of a fresh process, its threads included."""

import importlib
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

from surgsim.bench.children import in_child
from surgsim.packages import RECORDING, lacking

Row = dict[str, Any]

PARTS = {
    "interpreter": "Python itself",
    "import": "importing what a run needs",
    "prepare": "reading the scenario, building the models, solving the start",
    "first tick": "loading the kernels, the first tick",
    "run": "a second run to its end with its metrics, nothing written",
    "import recording": "importing what writes a recording",
    "recording": "writing its folder with the recording",
}


def measure_startup(case: str, repeat: int, settings: tuple[str, ...] = ()) -> list[Row]:
    """A row for each of `PARTS`, the median over processes [s of CPU]; the first of them is only to compile.

    Those of the recording are left out where a package for it is not installed.

    Args:
        case: Name of the case.
        repeat: Processes that count.
        settings: Values instead of the scenario's.
    """
    found = [in_child("surgsim.bench.startup:start", case, list(settings)) for _ in range(repeat + 1)][1:]
    return [
        {"part": part, "cpu_s": statistics.median(one[part] for one in found), "meaning": meaning}
        for part, meaning in PARTS.items()
        if part in found[0]
    ]


def start(name: str, settings: list[str]) -> dict[str, float]:
    """In a fresh process: CPU time of each part [s]."""
    clock = _Clock()
    clock.mark("interpreter")
    from surgsim.bench.cases import chosen
    from surgsim.runs.folder import execute, write_run
    from surgsim.simulate.loop import Simulation
    from surgsim.simulate.setup import prepare

    clock.mark("import")
    scenario = chosen([name])[0].scenario(*settings)
    setup = prepare(scenario)
    clock.mark("prepare")
    Simulation(setup).advance(1)
    clock.mark("first tick")
    execute(scenario)  # what is found once for all runs of a process is found here
    clock.mark("first run")
    result = execute(scenario)
    clock.mark("run")
    if lacking("", *RECORDING):
        return clock.took
    importlib.import_module("surgsim.recording.write")
    clock.mark("import recording")
    with tempfile.TemporaryDirectory() as folder:
        write_run(scenario, result, Path(folder) / "run", record=True)
    clock.mark("recording")
    return clock.took


class _Clock:
    """CPU time of this process between marks [s], the first since it began."""

    def __init__(self) -> None:
        self._last = 0.0
        self.took: dict[str, float] = {}

    def mark(self, name: str) -> None:
        """What was done since the last mark has this name."""
        now = time.process_time()
        self.took[name], self._last = now - self._last, now
