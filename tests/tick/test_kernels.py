"""A kernel is its own reference: the same bits as Python, compiled, in the loop, in threads."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from surgsim.control.instrument_estimators import INSTRUMENT_ESTIMATORS
from surgsim.control.joining import is_compiled
from surgsim.control.port_estimators import PORT_ESTIMATORS
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.torque_laws import TORQUE_LAWS
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare

PLUGINS = Path(__file__).parents[1] / "plugins"
PARTS = ("instrument", "port", "resolver", "law")
ANSWERS = """
import sys
import numpy as np
import outside
from surgsim.contract.arms import arm_of, cases, scenes
from surgsim.contract.problems import torque_problem, velocity_problem
from surgsim.control.external.given_commands import giving
from surgsim.control.failure import ControlFailure
from surgsim.control.port_estimators import PORT_ESTIMATORS
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.torque_laws import TORQUE_LAWS
from surgsim.models.config import RobotConfig, SceneConfig

fewer = {"self_motion": {"search_starts": 1}}  # a search in Python takes its time
kinds = ((RESOLVERS, velocity_problem, "step"), (TORQUE_LAWS, torque_problem, "torque"))
parts = [
    (catalog.config(name)(**fewer.get(name, {})), make, call)
    for catalog, make, call in kinds
    for name in catalog.names()
]
mine = giving({"mine": outside.command()})
mine.__enter__()
usual = SceneConfig(robot=RobotConfig(name="lwr4plus"))
for arm in map(arm_of, (usual, *scenes())):
    for config, make, call in parts:
        part = config.build(arm)
        if True not in cases(config, arm):
            continue
        memory = None
        for seed in range(4):
            try:
                found, memory = getattr(part, call)(make(arm, seed), memory)
            except ControlFailure as failure:
                print(config.type, seed, failure.detail)
                memory = None
                continue
            values = found if call == "torque" else found.qdot
            print(config.type, values.size, seed, values.tobytes().hex(), memory.tobytes().hex())
"""


def _printed(program, *, compiled):
    paths = [str(PLUGINS), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {
        **os.environ,
        "NUMBA_DISABLE_JIT": "0" if compiled else "1",
        "PYTHONPATH": os.pathsep.join(paths),
    }
    found = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=300
    )
    assert found.returncode == 0, found.stderr
    return found.stdout.splitlines()


def test_the_python_form_of_a_law_gives_the_bits_of_the_compiled_one():
    python, compiled = (_printed(ANSWERS, compiled=compiled) for compiled in (False, True))
    names = {line.split()[0] for line in python}
    assert names == {*RESOLVERS.names(), *TORQUE_LAWS.names()}
    assert python == compiled


RUN = """
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate

short = ["task.duration_s=0.12", "task.ramp_s=0.05", "task.hold_start_s=0", "task.hold_end_s=0"]
small = ["theatre=false", "task.radius_m=0.002"]
for controller in ("vprnn", "rcm_inverse_dynamics", "policy_proportional", "mink"):
    trace = simulate(load_scenario("circle_lwr4plus", controller=controller, assignments=[*short, *small]))
    print(controller, trace.block("q").tobytes().hex(), trace.block("tau").tobytes().hex())
off = "disturbances=[{type: calibration_error}, {type: instrument_tracker, delay_s: 0.003, field_m: 1.0e-4}]"
tracked = [*short, *small, off, "controller.instrument={type: tracked, ramp_s: 0.05}"]
trace = simulate(load_scenario("circle_lwr4plus", controller="rcm_inverse_dynamics", assignments=tracked))
print(trace.block("q").tobytes().hex(), trace.block("tip_believed").tobytes().hex())
"""


TELEOPERATION = """
import numpy as np
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate

bad = "task.channel={delay_s: 0.005, jitter_s: 0.004, loss: 0.2, burst_packets: 3.0, duplicate: 0.3}"
soon = ["task.duration_s=0.12", "task.operator.reaction_s=0.01", "task.operator.gaze_time_s=0.01"]
for mode in ("tank", "tdpa", "off"):
    law = f"task.bilateral.passivity={mode}"
    trace = simulate(load_scenario("teleop_wall_panda", assignments=[bad, *soon, law]))
    kept = [k for k, name in enumerate(trace.columns) if name != "control_time_s"]
    assert np.ptp(trace["handle_z_m"]) > 1e-4 and trace["late_packets"][-1] > 5.0
    print(mode, trace.data[:, kept].tobytes().hex())
"""


def test_a_teleoperation_in_python_gives_the_bits_of_the_compiled_loop():
    python, compiled = (_printed(TELEOPERATION, compiled=compiled) for compiled in (False, True))
    assert len(python) == 3
    assert python == compiled


def test_a_whole_run_in_python_gives_the_bits_of_the_compiled_loop():
    python, compiled = (_printed(RUN, compiled=compiled) for compiled in (False, True))
    assert len(python) == 5
    assert python == compiled


@pytest.mark.parametrize(
    "controller",
    [
        *("pinv", "vprnn", "self_motion", "joint_impedance", "rcm_inverse_dynamics"),
        *("policy_proportional", "mink"),
    ],
)
def test_a_function_without_its_decorator_runs_in_the_loop_with_the_same_trace(scenario, controller):
    made = scenario("task.duration_s=0.2", controller=controller)
    expected = simulate(made)
    setup = prepare(made)
    parts = setup.controller.parts
    plain = type(parts)(**{name: _undecorated(getattr(parts, name)) for name in PARTS})
    trace = Simulation(replace(setup, controller=setup.controller.with_parts(plain))).run()
    assert trace.equals(expected)


def _undecorated(part):
    """The part with its kernel as plain Python."""
    return replace(part, kernel=part.kernel.py_func)


def test_threads_do_not_disturb_each_other(scenario):
    made = [scenario(f"task.radius_m={0.002 + 0.0005 * i}", controller="vprnn") for i in range(4)]
    alone = [simulate(one) for one in made]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(simulate, made))
    for a, b in zip(alone, together, strict=True):
        assert a.equals(b)


def test_every_shipped_law_is_a_compiled_kernel_and_few_enter_python(arm):
    inside = set()
    for catalog in (RESOLVERS, TORQUE_LAWS, PORT_ESTIMATORS, INSTRUMENT_ESTIMATORS):
        for name in catalog.names():
            part = catalog.config(name)().build(arm)
            assert is_compiled(part), name
            if getattr(part, "inside", None) is not None:
                inside.add(name)
    assert inside == {"mink", "policy"}


def test_a_tick_at_a_time_gives_the_same_run(scenario):
    made = scenario("task.duration_s=0.2")
    stepped = Simulation(prepare(made))
    while not stepped.ended:
        stepped.tick()
    assert stepped.trace().equals(simulate(made))
    assert np.isfinite(stepped.trace()["t_s"]).all()
