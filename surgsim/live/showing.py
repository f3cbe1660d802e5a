"""A run that is watched in the viewer while it goes on."""

from pathlib import Path

from surgsim.compiled.watch import working_time
from surgsim.live.pace import Pace
from surgsim.recording.live import LiveView, viewer
from surgsim.runs.folder import RunResult, check_target, result_of, write_run
from surgsim.scenario.arms import Experiment
from surgsim.simulate.loop import Progress, Simulation, prepared

PIECE_S = 0.1
"""Simulated time between two looks [s]."""


def run_shown(
    scenario: Experiment,
    folder: Path,
    address: str | None,
    *,
    realtime: bool = True,
    record: bool = True,
    progress: Progress | None = None,
) -> RunResult:
    """Run a scenario into a folder, as without a viewer and with the same trace, and show it meanwhile.

    Args:
        scenario: What to run.
        folder: Where to write.
        address: Of a viewer, `host:port`; None opens a window.
        realtime: Whether to wait for the clock on the wall; a run that is slower is not caught up with.
        record: Whether to write `recording.rrd`.
        progress: Told of the progress.

    Raises:
        SurgsimError: If there is no viewer, the scenario cannot be started, or the folder cannot be written.
    """
    check_target(folder)
    with viewer(address) as stream:
        setup = prepared(scenario)
        try:
            began, duration, shown = working_time(), setup.duration_s, 0
            simulation, view, pace = Simulation(setup), LiveView(stream, scenario, duration), Pace()
            ticks = max(1, round(PIECE_S / scenario.simulation.control_period_s))
            while not simulation.ended:
                simulation.advance(ticks)
                view.show(simulation.trace(shown))
                shown = simulation.rows
                if realtime:
                    pace.wait(simulation.time_s)
                if progress is not None:
                    progress(simulation.time_s, duration)
            trace = simulation.run()  # the stop after it
            view.show(simulation.trace(shown))
        finally:
            setup.close()
        result = result_of(trace, working_time() - began)
        view.end(trace, result.metrics)
    check_target(folder)
    write_run(scenario, result, folder, record=record)
    return result
