"""Model-predictive control: its program against one with states, its gains, its limits, whole runs."""

from dataclasses import replace

import numpy as np
import pytest
import qpsolvers

import surgsim
from surgsim.contract.problems import torque_problem
from surgsim.control.torque_laws.base import seen_of_torque
from surgsim.control.torque_laws.rcm_hierarchy import fill_task_errors
from surgsim.control.torque_laws.rcm_mpc import RcmMpcConfig, plan, program
from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.tick.nominal import dynamics, kinematics

FREE = 1e9


@pytest.fixture(scope="module")
def arm():
    return ArmModel(SceneConfig(robot=RobotConfig(name="panda")))


def _seen(arm, seed, **changed):
    """A random state, with its model evaluated where the horizon begins."""
    problem = replace(torque_problem(arm, seed), **changed)
    seen = seen_of_torque(problem, arm)
    kinematics(seen.elsewhere, seen.q)
    dynamics(seen.elsewhere, seen.v)
    return seen


def _errors(seen):
    n, m = seen.q.size, 3 + seen.rows
    J, error, rate, bias = np.zeros((m, n)), np.zeros(m), np.zeros(m), np.zeros(m)
    fill_task_errors(seen, seen.elsewhere, 0.0, 0.0, J, error, rate, bias)
    return J, error, rate, bias


def _planned(config, arm, seen, d, last):
    law = config.build(arm)
    n = seen.q.size
    u = np.zeros(config.blocks * n)
    status = plan(law.gains, seen, seen.elsewhere, d, last, np.zeros(3 * u.size), u)
    return status, u.reshape(config.blocks, n)


def _with_states(config, seen, d, tau_max, rate_step, last, v_top):
    """The same optimum from a program whose variables are states and accelerations of every block.

    Errors are states with their own dynamics, e+ = e + h e' + h^2/2 e'', e'' = J u + b.
    """
    J, error, rate, bias = _errors(seen)
    m, n = J.shape
    N, H = config.blocks, config.horizon_s
    h, T = H / N, config.velocity_share * H
    weight = np.array([1.0] * 3 + [config.rcm_weight] * (m - 3))
    wide = 2 * m + 2 * n + n  # e, e', q - q_0, q', u
    P, c = np.zeros((N * wide, N * wide)), np.zeros(N * wide)
    A, b, low, high = [], [], np.full(N * wide, -np.inf), np.full(N * wide, np.inf)
    G, g = [], []
    M = seen.elsewhere.M
    joint = config.joint_bandwidth_rad_per_s
    posture = joint**2 * (seen.q_ref - seen.q) + 2 * joint * (seen.qdot_ref - seen.v)
    constant = seen.elsewhere.bias + seen.damping * seen.v - d
    for k in range(N):
        at = k * wide
        e, ed, dq, v, u = (
            slice(at + begin, at + begin + size)
            for begin, size in ((0, m), (m, m), (2 * m, n), (2 * m + n, n), (2 * m + 2 * n, n))
        )
        P[e, e], P[ed, ed] = np.diag(weight), T**2 * np.diag(weight)
        ridge = config.joint_weight * (0.5 * h * h) ** 2 / N
        P[u, u], c[u] = ridge * M, -ridge * M @ posture
        rows = np.zeros((2 * m + 2 * n, N * wide))
        rows[:m, e], rows[:m, u] = np.eye(m), -0.5 * h * h * J
        rows[m : 2 * m, ed], rows[m : 2 * m, u] = np.eye(m), -h * J
        rows[2 * m : 2 * m + n, dq], rows[2 * m : 2 * m + n, u] = np.eye(n), -0.5 * h * h * np.eye(n)
        rows[2 * m + n :, v], rows[2 * m + n :, u] = np.eye(n), -h * np.eye(n)
        right = np.concatenate((0.5 * h * h * bias, h * bias, np.zeros(2 * n)))
        if k == 0:
            right += np.concatenate((error + h * rate, rate, h * seen.v, seen.v))
        else:
            before = at - wide
            pe, ped = slice(before, before + m), slice(before + m, before + 2 * m)
            pq, pv = (
                slice(before + 2 * m, before + 2 * m + n),
                slice(before + 2 * m + n, before + 2 * m + 2 * n),
            )
            rows[:m, pe], rows[:m, ped] = -np.eye(m), -h * np.eye(m)
            rows[m : 2 * m, ped] = -np.eye(m)
            rows[2 * m : 2 * m + n, pq], rows[2 * m : 2 * m + n, pv] = -np.eye(n), -h * np.eye(n)
            rows[2 * m + n :, pv] = -np.eye(n)
        A.append(rows)
        b.append(right)
        low[v], high[v] = -v_top, v_top
        block = np.zeros((n, N * wide))
        block[:, u] = M
        most, least = tau_max - constant, -tau_max - constant
        if k == 0:
            most = np.minimum(most, last + rate_step - constant)
            least = np.maximum(least, last - rate_step - constant)
        G += [block, -block]
        g += [most, -least]
    scale = 1.0 / (0.5 * h * h) ** 2
    found = qpsolvers.solve_qp(
        scale * P + 1e-9 * np.eye(len(c)), scale * c, np.vstack(G), np.concatenate(g), np.vstack(A),
        np.concatenate(b), low, high, solver="daqp", primal_tol=1e-10, dual_tol=1e-10,
    )  # fmt: skip
    assert found is not None
    return found.reshape(N, wide)[:, -n:]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("limited", ["nothing", "torque and speed", "rate"])
def test_its_program_is_that_with_states(arm, seed, limited):
    """Condensed by us, uncondensed in the test: the same accelerations, with and without active limits."""
    config = RcmMpcConfig(horizon_s=0.03, joint_weight=0.05, delay_ticks=0)
    if limited == "rate":
        arm = ArmModel(SceneConfig(robot=RobotConfig(name="panda", drive="real")))
    seen = _seen(arm, seed)
    seen.q[:] = np.clip(seen.q, seen.q_min + 0.4, seen.q_max - 0.4)
    seen.v[:] *= 0.1
    kinematics(seen.elsewhere, seen.q)
    dynamics(seen.elsewhere, seen.v)
    seen.p_WTd[:] = seen.elsewhere.p_WT + 1e-3
    seen.v_WTd[:], seen.a_WTd[:] = 0.0, 0.0
    kin = arm.kinematics(seen.q)
    seen.p_WC[:] = kin.p_WT - 0.1 * kin.R_WT[:, 2] + 1e-3 * kin.R_WT[:, 0]
    seen.v_WC[:], seen.a_WC[:] = 0.0, 0.0
    d = np.linspace(-1.0, 1.0, seen.q.size)
    last = seen.elsewhere.bias - d
    seen.tau_max[:], seen.v_max[:] = FREE, FREE
    if limited == "torque and speed":
        seen.tau_max[:], seen.v_max[:] = np.abs(last) + 4.0, 0.15
    status, u = _planned(config, arm, seen, d, last)
    assert status == 0
    step = arm.drive.torque_rate * seen.dt_s if limited == "rate" else FREE
    v_top = np.full(seen.q.size, 0.97) * seen.v_max
    theirs = _with_states(config, seen, d, 0.999 * seen.tau_max, step, last, v_top)
    assert u == pytest.approx(theirs, rel=1e-4, abs=1e-3 * np.abs(theirs).max())
    torque = u @ seen.elsewhere.M.T + seen.elsewhere.bias + seen.damping * seen.v - d
    fast = seen.v + np.cumsum(u, axis=0) * 0.01
    assert (np.abs(torque) <= 0.999 * seen.tau_max * (1 + 1e-7)).all()
    assert (np.abs(fast) <= v_top * (1 + 1e-7)).all()
    change = np.abs(torque[0] - last)
    assert (change <= step * (1 + 1e-7)).all()
    if limited == "torque and speed":
        assert np.isclose(np.abs(torque), 0.999 * seen.tau_max, rtol=1e-6).any()
        assert np.isclose(np.abs(fast), v_top, rtol=1e-6).any()
    if limited == "rate":
        assert np.isclose(change, step, rtol=1e-6).any()


def test_no_joint_leaves_its_range_within_the_horizon(arm):
    """Joints near their ends, at speed and asked to go on: the rows of speed keep them inside."""
    config = RcmMpcConfig(horizon_s=0.1, delay_ticks=0)
    for seed in range(4):
        seen = _seen(arm, seed)
        seen.q[:] = seen.q_max - np.linspace(0.002, 0.05, seen.q.size)
        seen.v[:] = 0.5 * (seen.q_max - seen.q) * 10.0
        kinematics(seen.elsewhere, seen.q)
        dynamics(seen.elsewhere, seen.v)
        seen.q_ref[:], seen.tau_max[:] = seen.q_max + 1.0, FREE
        status, u = _planned(config, arm, seen, np.zeros(seen.q.size), seen.elsewhere.bias)
        assert status == 0
        q, v, h = seen.q.copy(), seen.v.copy(), 0.1 / 3
        for block in u:
            q, v = q + h * v + 0.5 * h * h * block, v + h * block
            assert (q <= seen.q_max).all()


@pytest.mark.parametrize("blocks", [1, 2, 3, 5])
def test_without_limits_the_errors_obey_a_differential_equation(arm, blocks):
    """Its k and d are those of a scalar double integrator, by least squares."""
    config = RcmMpcConfig(horizon_s=0.04, blocks=blocks, joint_weight=1e-8, delay_ticks=0)
    seen = _seen(arm, 3)
    seen.tau_max[:], seen.v_max[:] = FREE, FREE
    seen.q_min[:], seen.q_max[:] = -FREE, FREE
    J, error, rate, bias = _errors(seen)
    _, u = _planned(config, arm, seen, np.zeros(seen.q.size), seen.elsewhere.bias)
    h, T = 0.04 / blocks, config.velocity_share * 0.04
    t = h * np.arange(1, blocks + 1)
    reach = np.tril(h * (t[:, None] - t[None, :] + h / 2))
    effect = np.vstack((reach, T * h * np.tril(np.ones((blocks, blocks)))))
    stiffness = np.linalg.lstsq(effect, np.r_[np.ones(blocks), np.zeros(blocks)], rcond=None)[0][0]
    damping = np.linalg.lstsq(effect, np.r_[t, np.full(blocks, T)], rcond=None)[0][0]
    wanted = -stiffness * error - damping * rate
    assert J @ u[0] + bias == pytest.approx(wanted, rel=1e-4, abs=1e-4 * np.abs(wanted).max())
    if blocks == 3:
        frequency = np.sqrt(stiffness)
        assert frequency * 0.04 == pytest.approx(2.3, abs=0.05)
        assert damping / (2 * frequency) == pytest.approx(0.85, abs=0.02)


def test_the_horizon_follows_the_drives(arm):
    assert RcmMpcConfig().build(arm).gains[1] == pytest.approx(2.3 / 85.0)
    for name in ("lwr4plus", "panda", "fr3", "iiwa14"):
        real = ArmModel(SceneConfig(robot=RobotConfig(name=name, drive="real")))
        horizon = RcmMpcConfig().build(real).gains[1]
        assert horizon == pytest.approx(2.3 / min(0.4 * real.locked_frequency, 85.0))
        assert 0.02 <= horizon <= 0.05
    assert RcmMpcConfig(horizon_s=0.08).build(arm).gains[1] == 0.08


def test_where_no_torque_is_enough_it_says_so(arm):
    seen = _seen(arm, 0)
    seen.v_max[:], seen.tau_max[:] = 1e-3, 1e-3
    status, _ = _planned(RcmMpcConfig(), arm, seen, np.zeros(seen.q.size), np.zeros(seen.q.size))
    assert status != 0


def test_the_rate_of_the_torque_gives_way_before_the_speed():
    """A joint at its top speed is braked, though the drive's interface would not take the change."""
    real = ArmModel(SceneConfig(robot=RobotConfig(name="panda", drive="real")))
    seen = _seen(real, 1)
    config = RcmMpcConfig(horizon_s=0.03)
    seen.v_max[:], seen.tau_max[:] = 0.9 * np.abs(seen.v).max(), FREE
    far = seen.elsewhere.bias + 50.0
    status, u = _planned(config, real, seen, np.zeros(seen.q.size), far)
    assert status == 0
    assert (np.abs(seen.v + 0.01 * u[0]) <= 0.97 * seen.v_max * (1 + 1e-7)).all()
    narrow = seen.elsewhere.M @ u[0] + seen.elsewhere.bias + seen.damping * seen.v
    assert np.abs(narrow - far).max() > real.drive.torque_rate * seen.dt_s


def test_its_matrix_is_symmetric_and_definite(arm):
    seen = _seen(arm, 2)
    law = RcmMpcConfig().build(arm)
    H = program(law.gains, seen, seen.elsewhere, np.zeros(seen.q.size))[0]
    assert (H == H.T).all()
    assert np.linalg.eigvalsh(H).min() > 0.0


def test_a_path_that_is_too_fast_costs_the_tip_and_not_the_shaft():
    """A circle in a third of a second: speeds and torques stay inside their limits, and so does the RCM."""
    settings = {"task.duration_s": 0.3, "task.ramp_s": 0.03}
    run = surgsim.run("circle_panda", controller="rcm_mpc", settings=settings)
    assert run.trace.meta.ending.outcome is Outcome.COMPLETED
    assert 0.95 < run.metrics["joint_velocity_ratio_max"] <= 1.0
    assert 0.99 < run.metrics["torque_ratio_max"] <= 1.0
    assert run.metrics["tip_error_max_mm"] > 5.0
    assert run.metrics["rcm_error_max_mm"] < 0.4


def test_it_survives_real_drives():
    settings = {"robot.drive": "real", "task.duration_s": 3.0, "task.ramp_s": 0.5}
    run = surgsim.run("circle_fr3", controller="rcm_mpc", settings=settings)
    assert run.trace.meta.ending.outcome is Outcome.COMPLETED
    assert run.metrics["rcm_error_rms_mm"] < 0.05
    assert run.metrics["torque_rate_over_fraction"] < 0.01
