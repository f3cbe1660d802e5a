"""Tissue: its law, its force on the tip as measured there, and its energy."""

import numpy as np
import pytest

from surgsim.errors import ScenarioError, SurgsimError
from surgsim.plant.disturbances.tissue import FADE_M, TissueConfig, tissue_force
from surgsim.plant.disturbances.tissue import LAW as LAW_GAINS
from surgsim.simulate.setup import prepare

POINT, NORMAL = np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.6, 0.8])
LAW = np.array([300.0, 4.0, 6.0])
BENT = np.array([0.3, 0.6, 0.1, 1.4, -0.2, -0.8, 0.0])


def _random(rng, depth):
    tangent = np.cross(NORMAL, rng.normal(size=3))
    return POINT + 0.05 * tangent - depth * NORMAL, 0.2 * rng.normal(size=3)


def test_the_force_is_spring_damper_and_drag():
    rng = np.random.default_rng(0)
    for _ in range(200):
        depth = rng.uniform(FADE_M, 0.02)
        tip, v = _random(rng, depth)
        along = NORMAL * (NORMAL @ v)
        expected = max(0.0, 300.0 * depth - 4.0 * (NORMAL @ v)) * NORMAL - 6.0 * (v - along)
        np.testing.assert_allclose(tissue_force(tip, v, POINT, NORMAL, LAW), expected, atol=1e-12)


def test_outside_there_is_none_it_never_pulls_and_begins_at_zero():
    rng = np.random.default_rng(1)
    for _ in range(500):
        tip, v = _random(rng, rng.uniform(-0.01, 0.01))
        force = tissue_force(tip, v, POINT, NORMAL, LAW)
        assert force @ NORMAL >= -1e-15
        if (POINT - tip) @ NORMAL <= 0.0:
            np.testing.assert_array_equal(force, 0.0)
        touch, _ = _random(rng, 1e-9)
        assert np.abs(tissue_force(touch, v, POINT, NORMAL, LAW)).max() < 1e-5


def test_all_but_the_spring_takes_energy_out():
    rng = np.random.default_rng(2)
    for _ in range(500):
        depth = rng.uniform(0.0, 0.01)
        tip, v = _random(rng, depth)
        stored = -LAW[0] * depth * (NORMAL @ v)  # rate of k p^2 / 2
        assert tissue_force(tip, v, POINT, NORMAL, LAW) @ v + stored <= 1e-12


def _bounce(disturbed, arm, config, dt, ticks=600):
    """The arm, weightless, hits the tissue below its tip; ledger and depth at each tick."""
    q = BENT
    tip = arm.kinematics(q).p_WT
    plant = disturbed.plant_of(config(tip - [0.0, 0.0, 0.002]), dt=dt, ledger=True)
    state = plant.reset(q)
    down = np.linalg.pinv(arm.kinematics(q).Jv_WT) @ [0.02, 0.0, -0.1]
    plant.set_velocity(down)
    names = [c for block in plant.columns for c in block.columns]
    work = names.index("energy_applied_work_j")
    rows = []
    for _ in range(ticks):
        truth = plant.truth()
        bias = arm.dynamics(truth.q, truth.v).bias + arm.damping * truth.v
        state = plant.step(bias, np.zeros(7))
        rows.append((plant.truth().values[work], plant.truth().p_WT[2], state.f_T[2]))
    return np.array(rows), tip[2] - 0.002


@pytest.mark.parametrize("dt", [0.001, 0.0005])
def test_a_bounce_gives_back_no_more_than_it_took(disturbed, arm, dt):
    def soft(point):
        return TissueConfig(point_m=tuple(point), stiffness_n_per_m=3000.0, damping_n_s_per_m=10.0)

    rows, plane = _bounce(disturbed, arm, soft, dt)
    work, z, force = rows.T
    inside = z < plane
    assert inside.any()
    assert not inside[-1]
    assert work[inside].min() < -1e-3  # taken while pressing
    assert work[-1] < -1e-4  # lost for good
    assert work.max() <= 1e-9
    assert force.min() == 0.0
    kin, M = arm.kinematics(BENT), arm.dynamics(BENT, np.zeros(7)).mass_matrix
    undamped = 0.1 * np.sqrt(3000.0 / (kin.Jv_WT @ np.linalg.solve(M, kin.Jv_WT.T))[2, 2])  # v sqrt(k m)
    assert 0.7 * undamped < force.max() < undamped


def test_a_spring_alone_gives_back_what_it_took_to_second_order(disturbed, arm):
    def spring(point):
        keys = dict(stiffness_n_per_m=3000.0, damping_n_s_per_m=0.0, drag_n_s_per_m=0.0)
        return TissueConfig(point_m=tuple(point), **keys)

    kept = []
    for dt in (0.001, 0.0005, 0.00025):
        rows, plane = _bounce(disturbed, arm, spring, dt)
        assert rows[-1, 1] > plane
        kept.append(abs(rows[-1, 0]) / -rows[:, 0].min())
    assert kept[0] < 0.01
    assert kept[-1] < 0.5 * kept[0]


def test_the_tip_s_sensor_measures_it(disturbed, arm):
    q = BENT
    tip = arm.kinematics(q).p_WT
    above = tuple(tip + np.array([0.0, 0.0, 0.01]))
    config = TissueConfig(point_m=above, damping_n_s_per_m=0.0, drag_n_s_per_m=0.0)
    plant = disturbed.plant_of(config)
    plant.reset(q)
    state = plant.step(arm.dynamics(q, np.zeros(7)).bias, np.zeros(7))
    np.testing.assert_allclose(state.f_T, [0.0, 0.0, 2.0], atol=1e-9)
    J = arm.kinematics(q).Jv_WT
    M = arm.dynamics(q, np.zeros(7)).mass_matrix + disturbed.DT * np.diag(arm.damping)
    np.testing.assert_allclose(state.v, disturbed.DT * np.linalg.solve(M, J.T @ [0, 0, 2.0]), rtol=1e-6)


def test_its_law_is_drawn_from_the_seed():
    def law(seed):
        return TissueConfig(spread=0.4).build(np.random.default_rng(seed)).gains[LAW_GAINS]

    drawn = np.array([law(seed) for seed in range(40)])
    assert (drawn >= 0.6 * np.array([200.0, 2.0, 5.0])).all()
    assert (drawn <= 1.4 * np.array([200.0, 2.0, 5.0])).all()
    assert (np.ptp(drawn, axis=0) > 0.4 * np.array([200.0, 2.0, 5.0])).all()
    np.testing.assert_array_equal(law(3), drawn[3])


def test_what_cannot_be_stepped_or_has_no_tip_is_refused(scenario):
    stiff = "disturbances=[{type: tissue, stiffness_n_per_m: 20000.0, drag_n_s_per_m: 50.0}]"
    prepare(scenario(stiff))
    slow = ("simulation.timestep_s=0.004", "simulation.control_period_s=0.004")
    with pytest.raises(SurgsimError, match=r"must be at most 0\.2 kg with stiffness_n_per_m k 20000"):
        prepare(scenario(*slow, stiff))
    with pytest.raises(ScenarioError, match="normal must not be zero"):
        scenario("disturbances=[{type: tissue, normal: [0.0, 0.0, 0.0]}]")
