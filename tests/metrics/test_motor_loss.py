"""What is lost in the drives."""

import numpy as np
import pytest

import surgsim
from surgsim.metrics.catalog import compute_metrics


def test_the_loss_is_friction_times_the_motors_way():
    """Dry friction of 1 N m in every motor takes 1 J a radian; nothing else does."""
    settings = {
        "robot.drive": {"coulomb_nm": 1.0, "gear_damping_nm_s_per_rad": 0.0},
        "task.duration_s": 2.0,
        "task.ramp_s": 0.5,
    }
    trace = surgsim.run("circle_panda", controller="joint_elastic_dynamics", settings=settings).trace
    speed = np.abs(trace.block("motor_speed"))
    way = float(np.trapezoid(speed.sum(axis=1), trace["t_s"]))
    assert compute_metrics(trace)["motor_loss_j"] == pytest.approx(way, rel=0.03)


def test_ideal_drives_lose_nothing_that_is_known():
    trace = surgsim.run("circle_panda", settings={"task.duration_s": 1.0, "task.ramp_s": 0.3}).trace
    assert compute_metrics(trace)["motor_loss_j"] is None
