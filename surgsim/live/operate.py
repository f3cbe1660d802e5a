"""A teleoperation by a person, live or played again, into a run's folder."""

import contextlib
from pathlib import Path

from surgsim.compiled.watch import working_time
from surgsim.errors import SurgsimError
from surgsim.live import gamepad, keyboard
from surgsim.live.controls import Controls, Device
from surgsim.live.pace import Pace
from surgsim.live.session import drive, signals_end
from surgsim.live.window import Window, check_display
from surgsim.runs.folder import RunResult, check_target, result_of, write_run
from surgsim.scenario.schema import Scenario
from surgsim.simulate.loop import Progress, Simulation
from surgsim.simulate.setup import Setup, prepare
from surgsim.tasks.teleoperation import Teleoperation, TeleoperationConfig
from surgsim.teleop.manual.hand import LiveHand
from surgsim.teleop.manual.intent import Source
from surgsim.teleop.manual.tape import Recorder, source_of
from surgsim.trace.trace import Trace

DEVICES = ("keyboard", "gamepad")


def operate(
    scenario: Scenario, operator: str, folder: Path, *, record: bool = True, progress: Progress | None = None
) -> RunResult:
    """Let a person operate, and write the run's folder with `operator_input.csv`.

    Args:
        scenario: A teleoperation; what its simulated operator would do is left out.
        operator: `keyboard`, `gamepad`, or the path of an `operator_input.csv`, to be played again: the same
            scenario and input give the same trace, bit for bit.
        folder: Where to write; one that holds a person's input is not overwritten.
        record: Whether to write `recording.rrd`.
        progress: Told of a replay's progress.

    Raises:
        SurgsimError: If it is no teleoperation, the device, window or file is not there, the scenario cannot
            be started, or the folder cannot be written.
    """
    if not isinstance(scenario.task, TeleoperationConfig):
        raise SurgsimError(
            f"{scenario.name}: --operator needs task 'teleoperation', not '{scenario.task.type}'"
        )
    check_target(folder)
    if operator in DEVICES:
        return _live(scenario, operator, folder, record)
    recorder = Recorder(source_of(Path(operator)))
    simulation = _start(scenario, recorder)[1]
    began = working_time()
    trace = simulation.run(progress)
    return _written(scenario, trace, recorder, working_time() - began, folder, record)


def _live(scenario: Scenario, operator: str, folder: Path, record: bool) -> RunResult:
    keys = keyboard.Keyboard()
    devices: list[Device] = [keys]
    with contextlib.ExitStack() as held:
        if operator == "gamepad":
            devices.append(held.enter_context(gamepad.Gamepad(gamepad.find_gamepad())))
        help = gamepad.HELP if operator == "gamepad" else keyboard.HELP
        check_display()
        controls = Controls(devices)
        recorder = Recorder(controls)
        held.enter_context(signals_end(controls))
        setup, simulation = _start(scenario, recorder)
        with Window(setup, keys) as window:
            began = working_time()
            trace = drive(setup, simulation, controls, window, Pace(), help)
        return _written(scenario, trace, recorder, working_time() - began, folder, record)


def _start(scenario: Scenario, source: Source) -> tuple[Setup, Simulation]:
    """The simulation with a hand on the handle that follows `source`."""
    setup, config = prepare(scenario), scenario.task
    assert isinstance(config, TeleoperationConfig)
    assert isinstance(setup.task, Teleoperation)
    setup.task.hold(LiveHand(config.operator, config.mapping, source, scenario.control_period_s))
    return setup, Simulation(setup)


def _written(
    scenario: Scenario, trace: Trace, recorder: Recorder, wall_s: float, folder: Path, record: bool
) -> RunResult:
    result = result_of(trace, wall_s)
    write_run(scenario, result, folder, record=record, operator_input=recorder.text())
    return result
