"""The sliding-mode law: its formula, the layer that is reached and kept, what is left in it, real drives."""

import numpy as np
import pytest
from held_arm import held, nearest, rows_of

import surgsim
from surgsim.contract.problems import torque_problem
from surgsim.control.torque_laws.rcm_sliding_mode import RcmSlidingModeConfig
from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.scenario.load import load_scenario
from surgsim.simulate.setup import prepare

ROBOTS = ("test_arm_6", "lwr4plus", "panda", "test_arm_8")
GAINS = {
    "rcm_slope_per_s": 20.0,
    "rcm_reach_m_per_s2": 3.0,
    "rcm_layer_m_per_s": 0.04,
    "tip_slope_per_s": 15.0,
    "tip_reach_m_per_s2": 4.0,
    "tip_layer_m_per_s": 0.06,
    "joint_slope_per_s": 5.0,
    "joint_reach_rad_per_s2": 2.0,
    "joint_layer_rad_per_s": 0.7,
}


@pytest.fixture(scope="module")
def arms():
    return {name: ArmModel(SceneConfig(robot=RobotConfig(name=name))) for name in ROBOTS}


def per_row(config, m, key):
    return np.array([getattr(config, f"tip_{key}")] * 3 + [getattr(config, f"rcm_{key}")] * (m - 3))


def surface(config, rows, integral):
    """S of tip and RCM (m,), and what its rate has beside e'' (m,)."""
    slope = per_row(config, rows.error.size, "slope_per_s")
    if config.surface == "pd":
        return rows.rate + slope * rows.error, slope * rows.rate
    s = rows.rate + 2.0 * slope * rows.error + slope**2 * integral
    return s, 2.0 * slope * rows.rate + slope**2 * rows.error


def acceleration(config, p, integral, trocar=True):
    """The q'' that is asked for, from rows that are written anew and a KKT system."""
    rows = rows_of(p, trocar)
    m = rows.error.size
    reach, layer = per_row(config, m, "reach_m_per_s2"), per_row(config, m, "layer_m_per_s")
    s, drift = surface(config, rows, integral)
    a = -rows.bias - drift - reach * np.clip(s / layer, -1.0, 1.0)
    turning = p.v - p.resolution.qdot
    s_q = turning + config.joint_slope_per_s * (p.q - p.q_ref)
    pushed = np.clip(s_q / config.joint_layer_rad_per_s, -1.0, 1.0)
    posture = -config.joint_slope_per_s * turning - config.joint_reach_rad_per_s2 * pushed
    return nearest(p.dyn.mass_matrix, rows.J, a, posture), s / layer


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("kind", ["pd", "pid"])
@pytest.mark.parametrize("trocar", [True, False])
def test_it_is_the_law_that_its_page_writes(arms, name, kind, trocar):
    arm, config, sides = arms[name], RcmSlidingModeConfig(**GAINS, surface=kind), []
    for seed in range(5):
        p, integral = torque_problem(arm, seed, trocar=trocar), np.linspace(-4e-5, 5e-5, 5)
        terms, _ = config.build(arm).torque(p, integral)
        qddot, sides_here = acceleration(config, p, integral[: 5 if trocar else 3], trocar)
        h = p.dyn.bias + arm.damping * p.v
        expected = p.dyn.mass_matrix @ qddot + h
        np.testing.assert_allclose(terms.sum(axis=0), expected, atol=1e-9 * np.abs(expected).max())
        np.testing.assert_allclose(terms[3], h, rtol=1e-13)
        sides.extend(np.abs(sides_here))
    assert min(sides) < 1.0 < max(sides)  # both inside and outside the layer


def test_the_tip_does_not_move_the_rcm_nor_the_posture_either(arms):
    arm = arms["panda"]
    for seed in range(5):
        p = torque_problem(arm, seed)
        terms, _ = RcmSlidingModeConfig(**GAINS).build(arm).torque(p, None)
        moved, J = np.linalg.solve(p.dyn.mass_matrix, terms.T).T, rows_of(p).J
        assert np.abs(J[3:] @ moved[1]).max() < 1e-9 * np.abs(J[3:] @ moved[0]).max()
        assert np.abs(J @ moved[2]).max() < 1e-9
        assert np.abs(terms[2]).max() > 1e-3


def moved_by(p, torque):
    """What a joint torque adds to the accelerations of tip and RCM (5,)."""
    return rows_of(p).J @ np.linalg.solve(p.dyn.mass_matrix, torque)


def test_the_layer_is_reached_in_time_and_kept_under_a_bounded_disturbance(arms):
    """In MuJoCo, from 2 mm and a moving arm: |s| falls by k - |w| at least, and stays inside."""
    arm, config = arms["panda"], RcmSlidingModeConfig(**{**GAINS, "surface": "pd"})
    push = np.array([2.0, -1.5, 1.0, 1.5, 0.4, 0.3, 0.1])

    def disturbance(p, t):
        return push * np.sin(30.0 * t + np.arange(7))

    start = {"v": np.linspace(-0.3, 0.3, 7)}
    story = held(arm, config, 700, disturbance, start=start)
    reach, layer = per_row(config, 5, "reach_m_per_s2"), per_row(config, 5, "layer_m_per_s")
    s = np.array([surface(config, rows_of(p), 0.0)[0] for p, *_ in story])
    w = np.array([moved_by(p, disturbance(p, p.t_s)) for p, *_ in story])
    assert 0.2 < np.max(np.abs(w) / reach) < 0.9
    assert np.max(np.abs(s[0]) / layer) > 2.0  # it begins outside
    outside = np.abs(s[:-1]) > 1.05 * layer
    fallen = (np.abs(s[:-1]) - np.abs(s[1:])) / 0.001
    assert np.all(fallen[outside] > 0.9 * (reach - np.abs(w[:-1]))[outside])
    most = np.max((np.abs(s[0]) - layer) / (reach - np.abs(w).max(axis=0)))
    late = int(1100.0 * most) + 5
    assert late < 400
    assert np.all(np.abs(s[late:]) < layer)


def test_past_the_reach_the_layer_is_left(arms):
    """The bound is one: a disturbance above k is not held."""
    config = RcmSlidingModeConfig(**{**GAINS, "tip_reach_m_per_s2": 0.3, "rcm_reach_m_per_s2": 0.2})
    story = held(arms["panda"], config, 200, lambda p, t: np.array([6.0, 6.0, 0, 0, 0, 0, 0]))
    s = surface(config, rows_of(story[-1][0]), story[-1][2])[0]
    assert np.max(np.abs(s) / per_row(config, 5, "layer_m_per_s")) > 1.0


@pytest.mark.parametrize("kind", ["pd", "pid"])
def test_a_constant_disturbance_leaves_what_the_page_says(arms, kind):
    """E = w f/(k l) with the surface of the error and its rate, none with its integral."""
    arm, config = arms["panda"], RcmSlidingModeConfig(**{**GAINS, "surface": kind})
    story = held(arm, config, 2500, lambda p, t: np.array([1.0, -2.0, 1.0, 1.0, 0.3, 0.2, 0.0]))
    p = story[-1][0]
    w, rows = moved_by(p, np.array([1.0, -2.0, 1.0, 1.0, 0.3, 0.2, 0.0])), rows_of(p)
    stiff = per_row(config, 5, "reach_m_per_s2") / per_row(config, 5, "layer_m_per_s")
    left = w / (stiff * per_row(config, 5, "slope_per_s"))
    assert np.abs(left).max() > 2e-4
    expected = left if kind == "pd" else np.zeros(5)
    np.testing.assert_allclose(rows.error, expected, atol=0.02 * np.abs(left).max())


def test_the_integral_waits_outside_the_layer(arms):
    arm = arms["panda"]
    p = torque_problem(arm, 1)
    tight = RcmSlidingModeConfig(tip_layer_m_per_s=1e-9, rcm_layer_m_per_s=1e3)
    _, memory = tight.build(arm).torque(p, np.zeros(5))
    assert not memory[:3].any()
    np.testing.assert_allclose(memory[3:], 0.001 * p.rcm.error, rtol=1e-12)


def test_on_real_drives_slope_and_layer_are_shares_of_the_lowest_elastic_mode():
    arm = prepare(load_scenario("theatre_panda", controller="rcm_sliding_mode")).arm
    low = arm.locked_frequency
    assert np.isfinite(low)
    gains = RcmSlidingModeConfig(drive_slope_share=0.1, drive_layer_share=0.05).build(arm).gains
    np.testing.assert_allclose(gains[[0, 3]], min(60.0, 0.1 * low))
    np.testing.assert_allclose(gains[[1, 4]] / gains[[2, 5]], min(120.0, 0.05 * low))
    np.testing.assert_allclose(gains[6:9], (10.0, 5.0, max(0.5, 5.0 / (0.05 * low))))


@pytest.mark.parametrize("arm", ["lwr4plus", "panda", "fr3", "iiwa14"])
def test_as_shipped_it_completes_on_real_drives(arm):
    found = surgsim.run(
        load_scenario(
            f"random_{arm}_7",
            controller="rcm_sliding_mode",
            assignments=["robot.drive=real", "disturbances.1.coulomb_nm=0.0"],
        )
    )
    assert found.outcome == "completed"
    assert found.metrics["rcm_error_rms_mm"] < 2.0
