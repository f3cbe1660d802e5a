"""The project's own speed figures: how many times faster than real time, and where the time goes."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from surgsim.compiled.watch import working_time
from surgsim.errors import SurgsimError
from surgsim.metrics.catalog import compute_metrics
from surgsim.recording.write import write_recording
from surgsim.scenario.load import load_scenario, shipped
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

_SCENARIO = "circle_lwr4plus"
_NEEDS = {"rcm_interaction_force": ("trocar.wall={}",)}
"""What a controller needs in the scenario to be run at all."""


def bench(duration_s: float, repeat: int) -> list[dict[str, Any]]:
    """Best of `repeat` runs of the circle with every shipped controller, `duration_s` [s] each.

    Raises:
        SurgsimError: If the duration or count is not positive.
    """
    if not (duration_s >= 1.0 and repeat >= 1):
        raise SurgsimError("bench needs a duration of at least 1 s and at least one repeat")
    return [
        min((_once(name, duration_s) for _ in range(repeat)), key=lambda row: row["wall_s"])
        for name in shipped("controllers")
    ]


def _once(controller: str, duration_s: float) -> dict[str, Any]:
    settings = [
        f"task.duration_s={duration_s}",
        "task.ramp_s=0.5",
        "task.hold_start_s=0",
        "task.hold_end_s=0",
        *_NEEDS.get(controller, ()),
    ]
    scenario = load_scenario(_SCENARIO, controller=controller, assignments=settings)
    setup = prepare(scenario)
    began = working_time()
    trace = Simulation(setup).run()
    simulated = working_time()
    metrics = compute_metrics(trace)
    with TemporaryDirectory() as folder:
        write_recording(Path(folder) / "recording.rrd", trace, metrics)
    ended = working_time()
    return {
        "controller": controller,
        "real_time_factor": duration_s / (ended - began),
        "without_recording": duration_s / (simulated - began),
        "control_p50_us": metrics["control_time_p50_us"],
        "control_p99_us": metrics["control_time_p99_us"],
        "wall_s": ended - began,
    }
