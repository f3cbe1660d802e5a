"""A controlled stop on elastic drives, whose gears it does not know."""

import numpy as np
import pytest

import surgsim
from surgsim.errors import Outcome

PUSH = {"type": "push", "force_n": [300.0, 0.0, 0.0], "start_s": 0.5, "duration_s": 0.06}


def stopped(robot, **drive):
    return surgsim.run(
        f"circle_{robot}",
        controller="vprnn",
        settings={"robot.drive": drive or "real", "task.duration_s": 2.0, "safety.stop.duration_s": 1.0},
        disturbances=[PUSH],
    ).trace


@pytest.mark.parametrize("robot", ["panda", "fr3", "lwr4plus", "iiwa14"])
def test_it_brings_the_arm_to_rest(robot):
    trace = stopped(robot)
    assert trace.meta.ending.outcome is Outcome.VELOCITY_LIMIT
    speed = np.abs(trace.block("v")).max(axis=1)
    end = round(trace.meta.ending.t_s / trace.meta.control_period_s)
    assert len(speed) == end + 1 + 1000
    assert speed[-1] < 0.05
    assert speed[end + 500 :].max() < 0.4


def test_the_reflex_on_the_torques_rate_does_not_cut_it_short():
    """Braking begins with a step of the torque; once told, the interface clips."""
    trace = stopped("panda", past_torque_rate="stop", torque_rate_nm_per_s=3000.0)
    end = round(trace.meta.ending.t_s / trace.meta.control_period_s)
    assert len(trace) == end + 1 + 1000
    assert np.abs(trace.block("v"))[-1].max() < 0.3
