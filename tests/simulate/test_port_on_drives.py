"""An unseen breath on real drives: the wall's force is felt behind the motors' friction."""

import numpy as np
import pytest

import surgsim

UNSEEN = {"robot.drive": {"torque_rate_nm_per_s": 1000.0, "sensor_bias_nm": 0.3}, "task.duration_s": 6.0}
LOADED = [
    {"type": "payload", "mass_kg": 0.2},
    {"type": "inertia_error", "factor": 1.1},
    {"type": "sensor_noise", "velocity": "differentiated"},
    {"type": "actuation_delay", "delay_s": 0.002},
]


@pytest.mark.parametrize("robot", ["panda", "lwr4plus"])
def test_the_lateral_force_stays_below_a_newton(robot):
    breath = {"type": "breathing", "direction": [1.0, 0.0, 0.0], "seen": "hidden"}
    forces = {}
    for port in ("interaction_force", "measured"):
        run = surgsim.run(
            f"circle_{robot}",
            controller="rcm_elastic_dynamics",
            settings={**UNSEEN, "controller.port": {"type": port}},
            trocar={"wall": {}},
            disturbances=[breath, *LOADED],
        )
        assert run.outcome == "completed"
        lateral = np.linalg.norm(run.trace.block("trocar_force")[:, :2], axis=1)
        forces[port] = np.percentile(lateral[np.isfinite(lateral)], 99)
    assert forces["interaction_force"] < 1.0
    assert forces["measured"] > 3.0
