"""The guiding hand: its grip over time, its force, its bound."""

import numpy as np
import pytest

from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.plant.disturbances.guiding_hand import GuidingHandConfig, grip_at

STEADY = {"tremor": {"rms_m": 0.0}}


Q = [0.3, 0.5, 0.1, -1.2, 0.2, 0.7, 0.0]


@pytest.fixture
def pushed(disturbed):
    """Force on the instrument at `times` of an arm that does not move (n, 3) [N]."""

    def at(config, times, seed=0):
        scene = build(SceneConfig(robot=RobotConfig(name="lwr4plus"), theatre=False))
        hand = disturbed.started(config, seed, scene=scene, q=Q)
        body = int(scene.model.site_bodyid[scene.shaft_entry_site])
        wrenches = np.array([hand.push(float(t), k)[body] for k, t in enumerate(times)])
        lever = hand.data.site_xpos[scene.shaft_entry_site] - hand.data.xipos[body]
        np.testing.assert_allclose(wrenches[:, 3:], np.cross(lever, wrenches[:, :3]), atol=1e-12)
        return wrenches[:, :3]

    return at


def test_at_the_end_of_its_way_it_pulls_with_its_stiffness(pushed):
    config = GuidingHandConfig(travel_m=(0.01, 0.0, -0.02), stay_s=5.0, **STEADY)
    force = pushed(config, [0.5, 8.0])
    np.testing.assert_allclose(force[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(force[1], [3.0, 0.0, -6.0], atol=1e-9)


def test_it_pulls_no_harder_than_its_bound(pushed):
    config = GuidingHandConfig(travel_m=(0.3, 0.0, 0.0), force_max_n=7.0, stay_s=5.0, **STEADY)
    assert np.linalg.norm(pushed(config, [0.5, 8.0])[1]) == pytest.approx(7.0)


def test_it_takes_hold_and_lets_go(disturbed):
    hand = disturbed.started(GuidingHandConfig(start_s=1.0, duration_s=2.0, stay_s=0.5)).part
    times = [0.4, 0.75, 1.0, 3.5, 3.75, 4.1]
    assert [grip_at(hand.gains, t) for t in times] == pytest.approx([0.0, 0.5, 1.0, 1.0, 0.5, 0.0])


def test_its_tremor_is_of_its_seed(pushed):
    config, times = GuidingHandConfig(), np.arange(0.0, 1.0, 0.001)
    one, again, other = (pushed(config, times, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other).max() > 1e-3
