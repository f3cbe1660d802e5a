"""The adaptive law: its formula, its weights by differences, its Lyapunov function, payloads, real drives."""

import numpy as np
import pytest
from held_arm import held, nearest, rows_of

import surgsim
from surgsim.contract.problems import torque_problem
from surgsim.control.torque_laws.adaptive_decoupling import AdaptiveDecouplingConfig, fill_basis
from surgsim.control.torque_laws.rcm_inverse_dynamics import RcmInverseDynamicsConfig
from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.scenario.load import load_scenario

ROBOTS = ("test_arm_6", "lwr4plus", "panda", "test_arm_8")
TASKS = {
    "rcm_stiffness_per_s2": 150.0,
    "rcm_damping_ratio": 0.8,
    "tip_stiffness_per_s2": 90.0,
    "tip_damping_ratio": 1.1,
    "joint_stiffness_per_s2": 30.0,
    "joint_damping_ratio": 1.2,
}
LEARNING = {
    "adaptation_per_s2": 70.0,
    "leakage_per_s": 0.4,
    "nodes": 5,
    "slowest_rad_per_s": 0.01,
    "fastest_over_slowest": 30.0,
}
LEARNT = 4


@pytest.fixture(scope="module")
def arms():
    return {name: ArmModel(SceneConfig(robot=RobotConfig(name=name))) for name in ROBOTS}


def gaussians(config, velocity):
    """Phi (n, nodes) at joint velocities (n,)."""
    end = np.arcsinh(config.fastest_over_slowest)
    places = np.linspace(-end, end, config.nodes)
    z = np.clip(np.arcsinh(velocity / config.slowest_rad_per_s), -end, end)
    away = (z[:, None] - places) / (places[1] - places[0])
    raw = np.exp(-0.5 * away**2)
    return raw / raw.sum(axis=1, keepdims=True)


def damping(config, key):
    return 2.0 * getattr(config, f"{key}_damping_ratio") * np.sqrt(getattr(config, f"{key}_stiffness_per_s2"))


def per_row(config, m, get):
    return np.array([get("tip")] * 3 + [get("rcm")] * (m - 3))


def stiffness(config):
    return lambda key: getattr(config, f"{key}_stiffness_per_s2")


def lifted(config, p, rated, trocar=True):
    """The joint velocity (n,) that gives the rows `rated` e' + (k/d) e, nearest to the posture's."""
    rows = rows_of(p, trocar)
    slope = {key: stiffness(config)(key) / damping(config, key) for key in ("tip", "rcm", "joint")}
    s = rated * rows.rate + per_row(config, rows.error.size, slope.get) * rows.error
    posture = rated * (p.v - p.resolution.qdot) + slope["joint"] * (p.q - p.q_ref)
    return nearest(p.dyn.mass_matrix, rows.J, s, posture)


def sliding(config, p, trocar=True):
    """S (n,)."""
    return lifted(config, p, 1.0, trocar)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("trocar", [True, False])
def test_torque_and_rate_of_the_weights_are_the_formulas(arms, name, trocar):
    """The rate by the difference of two ticks' weights, over the period."""
    arm, config = arms[name], AdaptiveDecouplingConfig(**TASKS, **LEARNING)
    for seed in range(5):
        p = torque_problem(arm, seed, trocar=trocar)
        M, n, rows = p.dyn.mass_matrix, p.q.size, rows_of(p, trocar)
        m = rows.error.size
        weights = np.random.default_rng(seed).normal(size=(n, 5))
        inertia = np.linspace(1.0, 2.0, n)
        memory = np.concatenate([weights.ravel(), inertia])
        terms, after = config.build(arm).torque(p, memory)
        k, d = per_row(config, m, stiffness(config)), per_row(config, m, lambda key: damping(config, key))
        a = -rows.bias - k * rows.error - d * rows.rate
        posture = 30.0 * (p.q_ref - p.q) + damping(config, "joint") * (p.resolution.qdot - p.v)
        phi = gaussians(config, p.resolution.qdot)
        h, learnt = p.dyn.bias + arm.damping * p.v, np.sum(weights * phi, axis=1)
        expected = M @ nearest(M, rows.J, a, posture) + h + learnt
        np.testing.assert_allclose(terms.sum(axis=0), expected, atol=1e-9 * np.abs(expected).max())
        np.testing.assert_allclose(terms[LEARNT], learnt, rtol=1e-11)
        rate = (after[: n * 5].reshape(n, 5) - weights) / 0.001
        asked = -70.0 * (inertia * sliding(config, p, trocar))[:, None] * phi - 0.4 * weights
        np.testing.assert_allclose(rate, asked, atol=1e-8 * np.abs(asked).max())
        np.testing.assert_array_equal(after[n * 5 :], inertia)


def test_the_first_tick_takes_the_diagonal_of_the_inertia_and_has_learnt_nothing(arms):
    p, arm = torque_problem(arms["panda"], 2), arms["panda"]
    terms, memory = AdaptiveDecouplingConfig().build(arm).torque(p, None)
    assert not terms[LEARNT].any()
    np.testing.assert_array_equal(memory[-7:], np.diag(p.dyn.mass_matrix))
    assert memory[:-7].any()


@pytest.mark.parametrize("nodes", [1, 2, 7])
def test_the_basis_sums_to_one_and_is_mirrored(nodes):
    for velocity in (0.0, 0.003, 0.2, 50.0):
        there, back = np.empty(nodes), np.empty(nodes)
        fill_basis(velocity, 0.005, 100.0, there)
        fill_basis(-velocity, 0.005, 100.0, back)
        assert there.sum() == pytest.approx(1.0, abs=1e-14)
        np.testing.assert_allclose(there, back[::-1], atol=1e-14)
        if nodes == 7:
            config = AdaptiveDecouplingConfig()
            np.testing.assert_allclose(there, gaussians(config, np.array([velocity]))[0], rtol=1e-11)


def test_without_what_is_learnt_it_is_the_strict_hierarchy(arms):
    for seed in range(3):
        p = torque_problem(arms["lwr4plus"], seed)
        strict = RcmInverseDynamicsConfig(**TASKS, observer_gain=0.0, most_delay_ticks=0)
        expected = strict.build(arms["lwr4plus"]).torque(p, None)[0].sum(axis=0)
        found = AdaptiveDecouplingConfig(**TASKS).build(arms["lwr4plus"]).torque(p, None)[0].sum(axis=0)
        np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())


def weight_of(p):
    """What a mass of 0.5 kg at the tip asks of the joints (n,) [N m]."""
    return p.kin.Jv_WT.T @ np.array([0.0, 0.0, -0.5 * 9.81])


@pytest.mark.parametrize("learns", [True, False])
def test_a_payload_is_learnt_and_its_error_goes(arms, learns):
    """In MuJoCo; without adaptation the tip hangs by the payload over its stiffness."""
    config = AdaptiveDecouplingConfig(
        **{
            **TASKS,
            "tip_stiffness_per_s2": 900.0,
            "rcm_stiffness_per_s2": 900.0,
            "joint_stiffness_per_s2": 100.0,
        },
        adaptation_per_s2=800.0 if learns else 0.0,
        leakage_per_s=0.0,
    )
    story = held(arms["panda"], config, 5000, lambda p, t: weight_of(p))
    p, terms, _, _ = story[-1]
    error = np.abs(rows_of(p).error).max()
    if learns:
        np.testing.assert_allclose(terms[LEARNT], -weight_of(p), atol=0.002 * np.abs(weight_of(p)).max())
        assert error < 1e-5
    else:
        assert not terms[LEARNT].any()
        assert error > 2e-4


def test_the_lyapunov_function_falls(arms):
    """At rest, where phi stays one and the same, and the weights matter by w_i phi alone."""
    config = AdaptiveDecouplingConfig(
        **{**TASKS, "tip_stiffness_per_s2": 400.0, "rcm_stiffness_per_s2": 400.0},
        adaptation_per_s2=300.0,
        leakage_per_s=0.0,
    )
    push, phi = np.array([1.0, -2.0, 0.8, 1.2, 0.3, 0.2, 0.1]), gaussians(config, np.zeros(7))
    size, values = np.sum(phi**2, axis=1), []
    for p, terms, _, after in held(arms["panda"], config, 3000, lambda p, t: push):
        M, wrong = p.dyn.mass_matrix, terms[LEARNT] + push
        moving, away = lifted(config, p, 1.0), lifted(config, p, 0.0)
        values.append(moving @ M @ moving + away @ M @ away + np.sum(wrong**2 / (300.0 * after[49:] * size)))
    assert values[-1] < 0.01 * values[0]
    assert np.max(np.diff(values)) < 1e-5 * values[0]


def test_weights_that_nothing_upholds_leak_away(arms):
    p, arm = torque_problem(arms["panda"], 0), arms["panda"]
    law = AdaptiveDecouplingConfig(adaptation_per_s2=0.0, leakage_per_s=2.0).build(arm)
    memory = np.concatenate([np.ones(49), np.ones(7)])
    for _ in range(500):
        _, memory = law.torque(p, memory)
    np.testing.assert_allclose(memory[:49], (1.0 - 0.002) ** 500, rtol=1e-12)


@pytest.mark.parametrize("arm", ["lwr4plus", "panda", "fr3", "iiwa14"])
def test_as_shipped_it_completes_on_real_drives_and_learns(arm):
    errors = {}
    for rate in (0.0, 1000.0):
        found = surgsim.run(
            load_scenario(
                f"random_{arm}_7",
                controller="adaptive_decoupling",
                assignments=[
                    "robot.drive=real",
                    "disturbances.1.coulomb_nm=0.0",
                    f"controller.torque_law.adaptation_per_s2={rate}",
                ],
            )
        )
        assert found.outcome == "completed"
        errors[rate] = found.metrics["rcm_error_rms_mm"]
    assert errors[1000.0] < 0.5 * errors[0.0]
