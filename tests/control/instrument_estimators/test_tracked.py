"""Tracked: the filter against a batch solution, and what it learns of single errors."""

import numpy as np
import pytest
from scipy.linalg import expm, logm

from surgsim.control.instrument_estimators.base import InstrumentProblem
from surgsim.control.instrument_estimators.tracked import TrackedInstrumentConfig
from surgsim.plant.state import NOT_TRACKED, TrackedPose
from surgsim.spatial import skew

DT = 0.001
AT_ONCE = {"smoothing_s": 1e-9, "ramp_s": 1e-9}
EXACT = AT_ONCE | {"position_std_m": 1e-8, "angle_std_rad": 1e-8}
L = 0.4


def homogeneous(R, p):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def inverse(T):
    return homogeneous(T[:3, :3].T, -T[:3, :3].T @ T[:3, 3])


def vee(X):
    return np.array([*X[:3, 3], X[2, 1], X[0, 2], X[1, 0]])


def hat(x):
    X = np.zeros((4, 4))
    X[:3, :3], X[:3, 3] = skew(x[3:]), x[:3]
    return X


def adjoint(T):
    R, p = T[:3, :3], T[:3, 3]
    return np.block([[R, skew(p) @ R], [np.zeros((3, 3)), R]])


def tip(arm, q):
    kin = arm.kinematics(q)
    return homogeneous(kin.R_WT, kin.p_WT)


def block_columns(arm, q):
    """H (6, 61) as blocks Ad(T_nom^-1 T_k), from the frames of MuJoCo's bodies."""
    kin = arm.kinematics(q)
    data, model = arm._data, arm.scene.model
    T, n = homogeneous(kin.R_WT, kin.p_WT), q.size
    frame = lambda body, at: homogeneous(data.xmat[body].reshape(3, 3), at)  # noqa: E731
    base = model.body("base").id
    blocks = [adjoint(inverse(T) @ frame(base, data.xpos[base]))]
    for k in range(n):
        parent = model.body(f"link{k + 1}").parentid.item()
        blocks.append(adjoint(inverse(T) @ frame(parent, kin.anchors_W[k])))
    turned = np.vstack((T[:3, :3].T @ kin.Jv_WT, T[:3, :3].T @ kin.Jw_WT))
    return np.hstack((*blocks, turned, adjoint(homogeneous(np.eye(3), [0.0, 0.0, -L]))))


def follow(arm, positions, poses, *, age_ticks=0, every=1, **config):
    """Corrections (ticks, 6) at the joint positions of each tick.

    The poses are those of the first ticks; every so many one is measured, and seen `age_ticks` later.
    """
    estimator, memory, found = TrackedInstrumentConfig(**config).build(arm), None, []
    for k, q in enumerate(positions):
        sample, last = NOT_TRACKED, min(k - age_ticks, len(poses) - 1) // every
        if last >= 0:
            T, age_s = poses[every * last], (k - every * last) * DT
            sample = TrackedPose(samples=last + 1, age_s=age_s, p_WT=T[:3, 3], R_WT=T[:3, :3])
        problem = InstrumentProblem(t_s=k * DT, dt_s=DT, q=q, v=np.zeros(7), tracked=sample)
        correction, memory = estimator.step(problem, memory)
        found.append([*correction.linear, *correction.angular])
    return np.array(found)


@pytest.fixture
def path():
    """Joint positions of a slow wander (60, 7) [rad]."""
    t = np.arange(60)[:, None] * 0.02
    return 0.4 + 0.2 * np.sin(t * np.linspace(1.0, 2.0, 7) + np.arange(7))


def test_the_filter_is_the_batch_least_squares_with_priors(arm, path):
    rng, config = np.random.default_rng(0), TrackedInstrumentConfig(**AT_ONCE)
    prior = config.variances(7)
    x = rng.normal(size=61) * np.sqrt(prior)
    noise = np.repeat([config.position_std_m, config.angle_std_rad], 3)
    to_markers = adjoint(homogeneous(np.eye(3), [0.0, 0.0, L]))
    information, right, poses, answers = np.diag(1.0 / prior), np.zeros(61), [], []
    for q in path:
        H = block_columns(arm, q)
        measured = H @ x + np.linalg.solve(to_markers, noise * rng.normal(size=6))
        poses.append(tip(arm, q) @ expm(hat(measured)))
        A = to_markers @ H / noise[:, None]
        information += A.T @ A
        right += A.T @ (to_markers @ measured / noise)
        answers.append(H @ np.linalg.solve(information, right))
    found = follow(arm, path, poses, **AT_ONCE)
    assert np.abs(answers).max() > 5e-4
    np.testing.assert_allclose(found[1:], answers[1:], rtol=0.0, atol=2e-9)


ERRORS = {
    "tool": lambda arm, q: tip(arm, q) @ expm(hat([4e-4, -3e-4, 5e-4, 1e-3, -8e-4, 0.0])),
    "base": lambda arm, q: expm(hat([1e-3, -2e-3, 5e-4, 1e-3, 5e-4, -1e-3])) @ tip(arm, q),
    "offset of joint 2": lambda arm, q: tip(arm, q + 1e-3 * np.eye(7)[1]),
    "offset of joint 6": lambda arm, q: tip(arm, q - 1e-3 * np.eye(7)[5]),
}


@pytest.mark.parametrize("name", ERRORS)
def test_a_single_error_is_recovered_where_the_arm_has_been(arm, path, name):
    poses = [ERRORS[name](arm, q) for q in path]
    wide = dict.fromkeys(("base_position_m", "base_angle_rad", "tool_position_m", "joint_offset_rad"), 0.01)
    found = follow(arm, np.vstack((path, path)), [*poses, *poses], **EXACT, **wide)[len(path) :]
    wanted = [vee(logm(inverse(tip(arm, q)) @ T).real) for q, T in zip(path, poses, strict=True)]
    assert np.abs(wanted).max() > 3e-4
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=3e-7)


def test_what_was_learnt_holds_where_the_arm_has_not_been(arm, path):
    """An offset is found as what it does elsewhere too; the instrument's part alone would not."""
    away = path[-1] + np.array([0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0])
    unseen = np.linspace(path[-1], away, 20)
    positions, poses = np.vstack((path, unseen)), [ERRORS["base"](arm, q) for q in path]
    alone = dict.fromkeys(("base_position_m", "base_angle_rad", "joint_offset_rad"), 0.0)
    alone |= dict.fromkeys(("link_position_m", "link_angle_rad"), 0.0)
    wanted = vee(logm(inverse(tip(arm, away)) @ ERRORS["base"](arm, away)).real)
    left = [
        np.abs(follow(arm, positions, poses, **EXACT, **config)[-1] - wanted).max() for config in ({}, alone)
    ]
    assert left[0] < 0.2 * left[1]


@pytest.mark.parametrize("every", [1, 4])
def test_a_late_sample_is_paired_with_the_joints_of_its_time(arm, path, every):
    poses = [ERRORS["tool"](arm, q) for q in path]
    found = follow(arm, path, poses, age_ticks=7, every=every, **EXACT)[30:]
    for q, twist in zip(path[30:], found, strict=True):
        wanted = vee(logm(inverse(tip(arm, q)) @ ERRORS["tool"](arm, q)).real)
        np.testing.assert_allclose(twist, wanted, rtol=0.0, atol=3e-7)


def test_a_sample_older_than_what_is_remembered_does_not_count(arm, path):
    poses = [ERRORS["tool"](arm, q) for q in path]
    assert not follow(arm, path, poses, age_ticks=7, most_age_ticks=6, **EXACT).any()
    assert follow(arm, path, poses, age_ticks=7, most_age_ticks=7, **EXACT)[8:].any(axis=1).all()


def test_the_first_correction_is_let_in_smoothly(arm):
    q = np.tile(np.full(7, 0.4), (800, 1))
    poses = [ERRORS["tool"](arm, q[0])] * 800
    found = follow(arm, q, poses, position_std_m=1e-8, angle_std_rad=1e-8)
    wanted = vee(logm(inverse(tip(arm, q[0])) @ poses[0]).real)
    np.testing.assert_allclose(found[-1], wanted, rtol=0.0, atol=1e-8)
    assert not found[0].any()
    share = found[:, 0] / wanted[0]
    assert 0.3 < share[250] < 0.7
    assert np.all(np.diff(share) >= -1e-6)
    assert np.diff(share, 2).max() < 3.0 / 0.5**2 * 3.0 * DT**2  # the quintic's is 5.8 / T^2


def test_a_walk_forgets(arm):
    """The instrument is bent once: with a walk the filter follows, without it takes the mean."""
    q = np.tile(np.full(7, 0.4), (600, 1))
    poses = [tip(arm, q[0])] * 300 + [ERRORS["tool"](arm, q[0])] * 300
    wanted = vee(logm(inverse(poses[0]) @ poses[-1]).real)
    stays = follow(arm, q, poses, **AT_ONCE)[-1]
    walk = {"tool_walk_m_per_sqrt_s": 1e-3, "tool_walk_rad_per_sqrt_s": 1e-2}
    follows = follow(arm, q, poses, **AT_ONCE, **walk)[-1]
    np.testing.assert_allclose(stays[:3], 0.5 * wanted[:3], rtol=0.05)
    np.testing.assert_allclose(follows[:3], wanted[:3], rtol=0.05)
