from pathlib import Path

import numpy as np
import pytest

from surgsim.recording.write import write_recording
from surgsim.simulate.loop import simulate
from surgsim.trace.trace import Trace


@pytest.fixture(scope="session")
def metrics() -> dict[str, float | None]:
    return {"tip_error_rms_mm": 0.1 + 0.2, "manipulability_mean": 1e-300, "trocar_force_max_n": None}


@pytest.fixture(scope="session")
def trace(scenario) -> Trace:
    """A short dynamic run, with a row of NaN as at a tick at which a run is stopped, and odd numbers."""
    run = simulate(scenario("theatre=true"))
    data = run.data.copy()
    first = run.columns.index("tau1_nm")
    data[-1, first : first + 14] = np.nan
    data[3, first] = -0.0
    data[4, first] = np.nextafter(0.0, 1.0)
    data[5, first] = np.inf
    return Trace(data, run.blocks, run.meta)


@pytest.fixture(scope="session")
def recording(trace: Trace, metrics, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "recording.rrd"
    write_recording(path, trace, metrics)
    return path
