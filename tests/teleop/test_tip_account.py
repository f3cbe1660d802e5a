"""The tank's account of the tip's work against force times velocity at every physics step."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from surgsim.plant.part import PlantPart
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare


class Meter(PlantPart):
    """Integral of the power that the forces on the tip take, and of its size."""

    def __init__(self):
        self.taken = self.exchanged = 0.0
        self._last = None

    def push(self, t_s, scene, data):
        """Forces of the parts before it are there, positions and velocities are of the step's beginning."""
        twist, tip = np.zeros(6), scene.model.site(scene.tip_site).id
        mujoco.mj_objectVelocity(scene.model, data, mujoco.mjtObj.mjOBJ_SITE, tip, twist, 0)
        if self._last is not None:
            force, before = self._last
            work = -scene.model.opt.timestep * force @ (0.5 * (before + twist[3:]))
            self.taken += work
            self.exchanged += abs(work)
        self._last = data.xfrc_applied[scene.model.body("jaws").id][:3].copy(), twist[3:].copy()


@pytest.mark.parametrize("timestep", [0.001, 0.0005, 0.0001])
def test_the_account_is_the_integral_of_force_times_velocity(timestep):
    push = "[{position_m: [0.0, 0.65, -0.05], push: true, dwell_s: 0.6}]"
    scenario = load_scenario(
        "teleop_wall_panda",
        assignments=(
            f"simulation={{timestep_s: {timestep}, control_period_s: 0.001}}",
            "props.0.point_m=[0.0, 0.65, -0.033]",
            f"task.goals={push}",
            "task.channel={delay_s: 0.0}",
            "task.hold_end_s=0.3",
        ),
    )
    setup, meter = prepare(scenario), Meter()
    parts = [*scenario.build_parts(), meter]
    plant = scenario.plant.build(setup.scene, 0.001, parts, scenario.run_seed())
    trace = Simulation(replace(setup, plant=plant)).run()
    assert trace["tip_force_z_n"].max() > 10.0
    assert meter.exchanged > 0.01
    assert trace["environment_work_j"][-1] == pytest.approx(meter.taken, abs=0.01 * meter.exchanged)
    touch = trace["energy_applied_work_j"]
    at_tick = touch[:-1] + timestep / 0.001 * np.diff(touch)
    assert np.abs(trace["environment_work_j"][:-1] + at_tick).max() < 0.01 * meter.exchanged
