"""The guiding hand: its grip over time, its force, its bound."""

import mujoco
import numpy as np
import pytest

from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.plant.disturbances.guiding_hand import GuidingHandConfig

STEADY = {"tremor": {"rms_m": 0.0}}


def _pushed(config, times, seed=0):
    """Force on the instrument at `times` of an arm that does not move (n, 3) [N]."""
    scene = build(SceneConfig(robot=RobotConfig(name="lwr4plus"), theatre=False))
    data = mujoco.MjData(scene.model)
    data.qpos[:] = [0.3, 0.5, 0.1, -1.2, 0.2, 0.7, 0.0]
    mujoco.mj_forward(scene.model, data)
    hand = config.build(np.random.default_rng(0))
    hand.start(scene, data, np.random.default_rng(seed), 0.001)
    body = int(scene.model.site_bodyid[scene.shaft_entry_site])
    forces = []
    for t in times:
        data.xfrc_applied[:] = 0.0
        hand.push(float(t), scene, data)
        forces.append(data.xfrc_applied[body, :3].copy())
    moment = np.cross(data.site_xpos[scene.shaft_entry_site] - data.xipos[body], forces[-1])
    np.testing.assert_allclose(data.xfrc_applied[body, 3:], moment, atol=1e-12)
    return np.array(forces)


def test_at_the_end_of_its_way_it_pulls_with_its_stiffness():
    config = GuidingHandConfig(travel_m=(0.01, 0.0, -0.02), stay_s=5.0, **STEADY)
    force = _pushed(config, [0.5, 8.0])
    np.testing.assert_allclose(force[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(force[1], [3.0, 0.0, -6.0], atol=1e-9)


def test_it_pulls_no_harder_than_its_bound():
    config = GuidingHandConfig(travel_m=(0.3, 0.0, 0.0), force_max_n=7.0, stay_s=5.0, **STEADY)
    assert np.linalg.norm(_pushed(config, [0.5, 8.0])[1]) == pytest.approx(7.0)


def test_it_takes_hold_and_lets_go():
    hand = GuidingHandConfig(start_s=1.0, duration_s=2.0, stay_s=0.5).build(np.random.default_rng(0))
    times = [0.4, 0.75, 1.0, 3.5, 3.75, 4.1]
    assert [hand.grip_at(t) for t in times] == pytest.approx([0.0, 0.5, 1.0, 1.0, 0.5, 0.0])


def test_its_tremor_is_of_its_seed():
    config, times = GuidingHandConfig(), np.arange(0.0, 1.0, 0.001)
    one, again, other = (_pushed(config, times, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other).max() > 1e-3
