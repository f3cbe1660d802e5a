"""The columns of the geometry's errors, against plants that are built with them."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.linalg import block_diag, logm

from surgsim.control.instrument_estimators.geometry import fill_columns, parameters
from surgsim.control.instrument_estimators.tracked import bodies
from surgsim.control.seen import new_seen
from surgsim.models.arm import ArmModel
from surgsim.models.build import build
from surgsim.models.config import InstrumentConfig, RobotConfig, SceneConfig
from surgsim.plant.disturbances.calibration_error import CalibrationError, CalibrationErrorConfig
from surgsim.tick.nominal import place

ARMS = ("lwr4plus", "panda", "test_arm_6", "test_arm_8")
STEP = 1e-5
BACK = 0.31


class Given(CalibrationError):
    """Errors that are given, not drawn."""

    def __init__(self, x):
        super().__init__(CalibrationErrorConfig(), np.random.default_rng(0))
        self.x = x

    def errors(self, n):
        e, x = super().errors(n), self.x
        links = x[6 : 6 + 6 * n].reshape(n, 6)
        return replace(
            e,
            base_position=x[:3],
            base_angle=x[3:6],
            link_position=links[:, :3],
            link_angle=links[:, 3:],
            joint_offset=x[6 + 6 * n : 6 + 7 * n],
            tool_tip=x[6 + 7 * n : 9 + 7 * n],
            tool_angle=x[9 + 7 * n : 11 + 7 * n],
        )


def pose(scene, q, back):
    data = mujoco.MjData(scene.model)
    data.qpos[scene.qpos_ids] = q
    mujoco.mj_kinematics(scene.model, data)
    T = np.eye(4)
    T[:3, :3] = data.site_xmat[scene.tip_site].reshape(3, 3)
    T[:3, 3] = data.site_xpos[scene.tip_site] - back * T[:3, 2]
    return T


def columns(arm, q, back):
    seen, n = new_seen(arm, dt_s=0.001, has_trocar=False), q.size
    place(seen.elsewhere, q)
    H = np.full((6, parameters(n)), np.nan)
    fill_columns(seen.elsewhere, bodies(arm), arm.p_TA, back, H)
    return H


def own_axes(arm):
    """Turns errors in the axes of the displaced frames, as the plant has them, into those of the columns."""
    model, n = arm.scene.model, arm.limits.q_min.size
    turns = []
    for k in range(n):
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, model.body(f"link{k + 1}").quat)
        turns += [R.reshape(3, 3)] * 2
    return block_diag(np.eye(6), *turns, np.eye(n + 6))


def differences(config, q, back):
    """d log(T_nom^-1 T) / dx of plants that are built, by central differences (6, 7 n + 11)."""
    nominal, n = build(config), q.size
    T, rows = pose(nominal, q, back), []
    for i in range(parameters(n) - 1):  # the plant's instrument does not err about its own axis
        ends = []
        for side in (-STEP, STEP):
            x = np.zeros(parameters(n))
            x[i] = side
            X = logm(np.linalg.solve(T, pose(build(config, [Given(x)]), q, back))).real
            ends.append([*X[:3, 3], X[2, 1], X[0, 2], X[1, 0]])
        rows.append((np.array(ends[1]) - ends[0]) / (2.0 * STEP))
    return np.array(rows).T


@pytest.mark.parametrize("back", [0.0, BACK])
@pytest.mark.parametrize(
    ("name", "instrument"), [*((name, {}) for name in ARMS), ("panda", {"name": "hook_30"})]
)
def test_columns_are_the_finite_differences_of_plants_with_the_errors(name, instrument, back):
    robot = RobotConfig(name=name, base_yaw_rad=0.7)
    config = SceneConfig(theatre=False, robot=robot, instrument=InstrumentConfig(**instrument))
    arm = ArmModel(config)
    low, high = arm.limits.q_min, arm.limits.q_max
    q = np.random.default_rng(1).uniform(low, high)
    found = (columns(arm, q, back) @ own_axes(arm))[:, :-1]
    wanted = differences(config, q, back)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-8)
    assert np.abs(columns(arm, q + 0.01, back) - columns(arm, q, back)).max() > 1e-3  # the check can tell


def test_a_turn_about_the_shaft_is_the_last_column(arm):
    H = columns(arm, np.full(7, 0.4), BACK)
    np.testing.assert_allclose(H[:, -1], [0.0, 0.0, 0.0, 0.0, 0.0, 1.0], atol=1e-15)
