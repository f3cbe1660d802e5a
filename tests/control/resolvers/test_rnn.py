"""RNN against eq. (6)-(9) of the manipulability paper written with dense Kronecker products."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from usual_arm import usual_arm

from surgsim.control.failure import ControlFailure
from surgsim.control.resolvers.rnn import RnnConfig
from surgsim.errors import Outcome

seeds = pytest.mark.parametrize("seed", range(3))
VEC_I = np.eye(3).ravel(order="F")


@dataclass(frozen=True, kw_only=True)
class States:
    """The network's neural states, as the kernel lays them out in its memory."""

    omega: np.ndarray
    phi: np.ndarray
    lam: np.ndarray
    sigma: np.ndarray

    def memory(self, network):
        out = np.zeros(network.memory_size)
        out[:7], out[7:16], out[16:25] = self.omega, self.phi, self.sigma
        out[25 : 25 + len(self.lam)] = self.lam
        return out

    @staticmethod
    def of(memory, rows):
        return States(omega=memory[:7], phi=memory[7:16], sigma=memory[16:25], lam=memory[25 : 25 + rows])


def _network(config):
    return config.build(usual_arm())


def _calm(p):
    """The states before the first step: at rest, phi at its solution."""
    A = p.kin.Jv_WT @ p.kin.Jv_WT.T
    rows = 3 if p.rcm is None else 5
    return States(omega=np.zeros(7), phi=np.linalg.inv(A).ravel(), lam=np.zeros(rows), sigma=np.zeros(9))


def _unbounded(problem):
    return replace(problem, lower=np.full(7, -np.inf), upper=np.full(7, np.inf))


def _derivatives(arm, q, h=1e-6):
    """H_i = dJ/dq_i by central differences."""
    return [(arm.kinematics(q + h * e).Jv_WT - arm.kinematics(q - h * e).Jv_WT) / (2 * h) for e in np.eye(7)]


def _rows(p, k=5.0):
    J = p.kin.Jv_WT
    v = p.command.v_WTd + k * (p.command.p_WTd - p.kin.p_WT)
    if p.rcm is None:
        return J, v
    return np.vstack([J, p.rcm.jacobian]), np.concatenate([v, p.rcm.trocar_velocity - k * p.rcm.error])


def _literal(arm, p, c, memory, steps):
    """Explicit Euler steps of eq. (6)-(9); the mean of omega over them, and the last states."""
    J, (J_a, v) = p.kin.Jv_WT, _rows(p, c.k_tip)
    D = np.array([(J @ H.T).ravel(order="F") for H in _derivatives(arm, p.q)])
    B = np.kron(np.eye(3), J @ J.T)
    w, phi, lam, sigma = memory.omega, memory.phi, memory.lam, memory.sigma
    h, total = p.dt_s / steps / c.epsilon_s, 0.0
    for _ in range(steps):
        inside = c.c3 * D @ phi - c.c0 * J_a.T @ (J_a @ w - v) + (1.0 - c.c2) * w - J_a.T @ lam
        to_w = -w + np.clip(inside, p.lower, p.upper)
        to_phi = -c.c3 * D.T @ w + B @ sigma + c.c1 * B @ (B @ phi - VEC_I)  # as printed
        if c.form == "corrected":
            to_phi = c.c3 * D.T @ w + B @ sigma - c.c1 * B @ (B @ phi - VEC_I)
        to_lam, to_sigma = J_a @ w - v, VEC_I - B @ phi
        w, phi, lam, sigma = w + h * to_w, phi + h * to_phi, lam + h * to_lam, sigma + h * to_sigma
        total = total + w
    return total / steps, States(omega=w, phi=phi, lam=lam, sigma=sigma)


def _random_memory(p, seed):
    rng = np.random.default_rng(seed + 7)
    rows = 3 if p.rcm is None else 5
    return States(
        omega=rng.standard_normal(7),
        phi=rng.standard_normal(9),
        lam=rng.standard_normal(rows),
        sigma=rng.standard_normal(9),
    )


def test_defaults_are_table_1_of_the_vprnn_paper():
    """h0 = h1 = 0.01, h2 = h4 = 1, k1 = 5, beta = 1000, with c3 = h0, c2 = h1, c0 = h2, c1 = h4."""
    c = RnnConfig()
    assert (c.c3, c.c2, c.c0, c.c1) == (0.01, 0.01, 1.0, 1.0)
    assert c.k_tip == 5.0
    assert c.epsilon_s == 1.0 / 1000.0
    assert c.form == "corrected"


@seeds
@pytest.mark.parametrize("form", ["corrected", "printed"])
@pytest.mark.parametrize("trocar", [True, False])
@pytest.mark.parametrize("substeps", [1, 7])
def test_a_step_is_that_of_the_equations(arm, velocity_problem, seed, form, trocar, substeps):
    config = RnnConfig(c0=0.7, c1=1.3, c2=0.2, c3=0.3, epsilon_s=0.01, form=form, step_over_epsilon=0.05)
    p = replace(velocity_problem(seed, trocar=trocar, speed=0.5), dt_s=0.0005 * substeps)
    memory = _random_memory(p, seed)
    mean, expected = _literal(arm, p, config, memory, substeps)
    network = _network(config)
    answer, after = network.step(p, memory.memory(network))
    stepped = States.of(after, len(memory.lam))
    for name in ("omega", "phi", "lam", "sigma"):
        np.testing.assert_allclose(getattr(stepped, name), getattr(expected, name), atol=1e-8, err_msg=name)
    # the mean is over the period, whichever end of a substep counts
    half = 0.5 * (expected.omega - memory.omega) / substeps
    gap = np.abs(answer.qdot - np.clip(mean - half, p.lower, p.upper))
    assert (gap <= np.abs(half) + 1e-8).all()


@seeds
def test_it_starts_at_rest_with_phi_solved(velocity_problem, seed):
    p = velocity_problem(seed)
    network = _network(RnnConfig())
    first, from_calm = network.step(p, network.start(p))[1], network.step(p, _calm(p).memory(network))[1]
    np.testing.assert_allclose(first, from_calm, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", [0, 2, 3])  # slow where J J^T has a small eigenvalue
@pytest.mark.parametrize("trocar", [True, False])
def test_steady_state_is_pinv_plus_the_gradient_times_c3_over_c2(arm, velocity_problem, seed, trocar):
    """Where nothing moves any more, what is left of the derivatives bounds the distance from the answer."""
    config = RnnConfig(c1=20.0, c2=0.25, c3=0.05)
    p = replace(_unbounded(velocity_problem(seed, trocar=trocar, rcm_error_m=0.001)), dt_s=0.1)
    network = _network(config)
    memory = network.start(p)
    for _ in range(60):
        before = memory
        answer, memory = network.step(p, memory)
    before, memory = States.of(before, 0), States.of(memory, 0)
    J, v = _rows(p)
    psi = np.linalg.inv(p.kin.Jv_WT @ p.kin.Jv_WT.T)
    gradient = np.array([np.trace(H @ p.kin.Jv_WT.T @ psi) for H in _derivatives(arm, p.q)])
    Jp = np.linalg.pinv(J)
    climb = (config.c3 / config.c2) * (np.eye(7) - Jp @ J) @ gradient
    unsettled = np.abs(memory.omega - before.omega).max() + np.abs(memory.phi - before.phi).max()
    tolerance = 1e-7 + 100.0 * unsettled
    assert tolerance < 1e-2 * np.abs(climb).max()
    np.testing.assert_allclose(answer.qdot, Jp @ v + climb, atol=tolerance)


@seeds
def test_integrated_tip_error_is_epsilon_times_lambda(velocity_problem, seed):
    """With a constant Jacobian and no feedback, from eq. (8)."""
    p = _unbounded(velocity_problem(seed))
    network = _network(RnnConfig(k_tip=0.0, k_rcm=0.0))
    J, v = _rows(p, 0.0)
    memory = network.start(p)
    error = np.zeros(len(v))
    for _ in range(7):
        answer, memory = network.step(p, memory)
        error += p.dt_s * (J @ answer.qdot - v)
    expected = 1e-3 * States.of(memory, len(v)).lam
    assert np.abs(expected[:3]).max() > 1e-5
    np.testing.assert_allclose(error, expected, atol=1e-12)


def _deviation(config, p, start):
    """Largest eigenvalue of J J^T; phi and sigma along its vector a period after phi was off by `start`."""
    g, U = np.linalg.eigh(p.kin.Jv_WT @ p.kin.Jv_WT.T)
    u, g = U[:, -1], g[-1]
    network, calm = _network(config), _calm(p)
    _, memory = network.step(p, replace(calm, phi=calm.phi + start * np.kron(u, u)).memory(network))
    memory = States.of(memory, len(calm.lam))
    return g, np.kron(u, u) @ (memory.phi - calm.phi), np.kron(u, u) @ memory.sigma


@seeds
@pytest.mark.parametrize(("form", "sign"), [("printed", -1.0), ("corrected", 1.0)])
def test_deviations_of_phi_follow_the_characteristic_polynomial(velocity_problem, seed, form, sign):
    """Epsilon^2 s^2 +- c1 g^2 epsilon s + g^2: the roots of the printed form are in the right half plane."""
    p = replace(_unbounded(velocity_problem(seed, trocar=False)), dt_s=0.005)
    c1, h = 1.5, 0.01
    config = RnnConfig(c1=c1, c3=0.0, epsilon_s=0.001, form=form, step_over_epsilon=h)
    g, phi, sigma = _deviation(config, p, 1e-3)
    system = np.array([[-sign * c1 * g * g, g], [-g, 0.0]])  # of phi and sigma, time in epsilon
    roots = np.roots([1.0, sign * c1 * g * g, g * g])
    np.testing.assert_allclose(np.sort_complex(np.linalg.eigvals(system)), np.sort_complex(roots), atol=1e-12)
    assert np.sign(roots.real).tolist() == [-sign, -sign]
    expected = np.linalg.matrix_power(np.eye(2) + h * system, 500) @ [1e-3, 0.0]
    np.testing.assert_allclose([phi, sigma], expected, rtol=1e-6, atol=1e-12)


@seeds
def test_the_printed_form_diverges_and_the_corrected_one_does_not(velocity_problem, seed):
    p = replace(velocity_problem(seed, rcm_error_m=0.0), dt_s=0.05)

    def run(form):
        network = _network(RnnConfig(form=form))
        memory = network.start(p)
        for _ in range(200):
            answer, memory = network.step(p, memory)
        return answer

    assert np.isfinite(run("corrected").qdot).all()
    with pytest.raises(ControlFailure, match=r"printed form\): a neural state exceeds 1e12") as failure:
        run("printed")
    assert failure.value.outcome is Outcome.DIVERGED


@seeds
def test_omega_and_the_answer_stay_inside_the_bounds(velocity_problem, seed):
    p = velocity_problem(seed, speed=5.0)
    network = _network(RnnConfig())
    memory = network.start(p)
    for _ in range(50):
        answer, memory = network.step(p, memory)
        for qdot in (answer.qdot, memory[:7]):
            assert (qdot >= p.lower - 1e-12).all()
            assert (qdot <= p.upper + 1e-12).all()
    assert np.isclose(np.abs(answer.qdot), np.where(answer.qdot > 0, p.upper, -p.lower), rtol=1e-3).any()
