"""The wall: its law, and its energy, in one dimension and on the whole arm."""

import numpy as np
import pytest

from surgsim.errors import ScenarioError, SurgsimError
from surgsim.plant.disturbances.guiding_hand import GuidingHandConfig
from surgsim.plant.disturbances.payload import PayloadConfig
from surgsim.plant.disturbances.push import PushConfig
from surgsim.plant.explicit import pressure
from surgsim.plant.props.contact_wall import OUTSIDE, PAST, PRESSED, ContactWallConfig, wall_force, where
from surgsim.scenario.load import load_scenario
from surgsim.simulate.setup import prepare

STIFFNESS, DAMPING, H = 20000.0, 100.0, 0.001
DOWN = np.array([0.0, 0.0, -1.0])


def _gains(**keys):
    return ContactWallConfig(**keys).build(np.random.default_rng(0)).gains


def _force(gains, depth, velocity, h=H):
    out = np.zeros(3)
    wall_force(gains, depth, np.array(velocity, dtype=float), h, out)
    return out


def test_the_force_is_spring_damper_and_friction():
    rng, normal = np.random.default_rng(0), np.array([0.0, 0.6, 0.8])
    gains = _gains(normal=(0.0, 3.0, 4.0), friction=0.3)
    for _ in range(300):
        depth, v, h = rng.uniform(1e-6, 0.003), 0.2 * rng.normal(size=3), rng.choice([0.0, 1e-4, 1e-3])
        into, side = -normal @ v, v - normal * (normal @ v)
        f = max(0.0, STIFFNESS * (depth + 0.2 * h * into) + DAMPING * min(1.0, depth / 5e-4) * into)
        creep = min(0.3 * f / np.linalg.norm(side), 100.0)
        np.testing.assert_allclose(_force(gains, depth, v, h), f * normal - creep * side, atol=1e-12)


def test_it_never_pulls_begins_at_zero_and_takes_energy_but_for_its_spring():
    rng, gains = np.random.default_rng(1), _gains(friction=0.5)
    for _ in range(500):
        depth, v = rng.uniform(0.0, 0.002), 0.3 * rng.normal(size=3)
        force = _force(gains, depth, v, 0.0)
        assert force[2] >= 0.0
        assert force @ v <= STIFFNESS * depth * v[2] + 1e-12  # what the spring gives back, at most
        assert np.abs(_force(gains, 1e-9, v, 0.0)).max() < 1e-3
    np.testing.assert_array_equal(_force(gains, 0.0, v), 0.0)


def _bounce(mass, stiffness, damping, speed, phase, force):
    """Share of its energy that a mass loses in a bounce, stepped as MuJoCo does; it begins outside."""
    p, v = -phase * speed * H - 1e-15, speed
    for _ in range(20000):
        f = force(stiffness, damping, p, v)
        v -= H * f / mass
        p += H * v
        if p <= 0.0 and v <= 0.0:
            return 1.0 - (v / speed) ** 2
    raise AssertionError("it stays in the wall")


def _ahead(steps):
    return lambda k, b, p, v: pressure(p, v, k, b, steps * H)


def _wall(k, b, p, v):
    return _force(_gains(stiffness_n_per_m=k, damping_n_s_per_m=b), p, [0.0, 0.0, -v])[2] if p > 0.0 else 0.0


@pytest.mark.parametrize("law", [(20000.0, 100.0), (20000.0, 0.0), (100000.0, 100.0), (190000.0, 10.0)])
def test_a_bounce_gives_back_no_more_than_it_took_at_any_speed_and_phase(law):
    """800 cases of each law at the edge of what is let through: k h^2 + b h <= 0.2 kg, 0.2 kg and more."""
    cases = [(v, x) for v in np.geomspace(1e-3, 1.0, 20) for x in np.arange(20) / 20.0]
    for mass in (0.2, 1.0):
        lost = np.array([_bounce(mass, *law, speed, phase, _ahead(0.2)) for speed, phase in cases])
        assert lost.min() > 0.0, (mass, cases[int(lost.argmin())])
    some = [_bounce(0.2, *law, speed, phase, _wall) for speed, phase in cases[::37]]
    assert some == pytest.approx([_bounce(0.2, *law, *case, _ahead(0.2)) for case in cases[::37]], rel=1e-9)


def test_without_its_look_ahead_a_sampled_spring_gives_energy_out():
    lost = [
        _bounce(0.2, 100000.0, 100.0, v, x, _ahead(0.0)) for v in (0.01, 0.1) for x in np.arange(20) / 20.0
    ]
    assert min(lost) < -0.05


def test_a_contact_begins_at_the_face_alone():
    gains = _gains(point_m=(0.0, 0.0, 0.0), size_m=0.02)
    path = [(0.0, 0.001, OUTSIDE), (0.0, -0.001, PRESSED), (0.0099, -0.001, PRESSED), (0.0101, -0.001, PAST)]
    path += [(0.0, -0.001, PAST), (0.0, 0.0, OUTSIDE), (0.0, -1e-6, PRESSED), (0.0, -0.02, PRESSED)]
    before = PAST  # as at first
    assert where(gains, np.array([0.0, 0.0, -0.005]), before) == PAST
    for x, z, expected in path:
        before = where(gains, np.array([x, 0.0, z]), before)
        assert before == expected, (x, z)
    assert where(gains, np.array([0.0, 0.011, -0.001]), OUTSIDE) == PAST


@pytest.fixture(scope="module")
def scenario():
    def make(timestep=H, **keys):
        steps = (f"simulation.timestep_s={timestep}", "plant={type: dynamic, energy_ledger: true}")
        steps = (*steps, "theatre=false")
        scene = load_scenario("circle_panda", controller="rcm_inverse_dynamics", assignments=steps)
        return scene.model_copy(update={"props": (ContactWallConfig(**keys),)})

    return make


class Arm:
    """The Panda, weightless, with a wall 1 mm below its tip."""

    def __init__(self, scenario, timestep=H, disturbances=(), **keys):
        self.q = prepare(scenario()).q_start
        bare = prepare(scenario())
        self.arm, here = bare.arm, bare.arm.kinematics(self.q)
        self.face = here.p_WT + 0.001 * DOWN
        setup = scenario(timestep, point_m=tuple(self.face), **keys)
        setup = prepare(setup.model_copy(update={"disturbances": tuple(disturbances)}))
        self.plant, self.J = setup.plant, here.Jv_WT
        names = [c for block in self.plant.columns for c in block.columns]
        self.work = names.index("energy_applied_work_j")

    def hit(self, velocity, ticks=400):
        """Depth, force (3,) and energy taken so far, by the ledger and by force times velocity."""
        self.plant.reset(self.q)
        state, rows, taken = self.plant.set_velocity(np.linalg.pinv(self.J) @ velocity), [], 0.0
        for _ in range(ticks):
            bias = self.arm.dynamics(state.q, state.v).bias + self.arm.damping * state.v
            before = self.arm.kinematics(state.q).Jv_WT @ state.v
            state = self.plant.step(bias, np.zeros(7))
            after = self.arm.kinematics(state.q)
            taken -= H * state.f_T @ (0.5 * (before + after.Jv_WT @ state.v))
            truth = self.plant.truth()
            rows.append((self.face[2] - truth.p_WT[2], *state.f_T, -truth.values[self.work], taken))
            if rows[-1][0] < 0.0 and len(rows) > 1 and rows[-2][3] > 0.0:
                break
        return np.array(rows)


@pytest.fixture(scope="module")
def panda(scenario):
    return Arm(scenario)


def test_on_the_whole_arm_every_contact_takes_energy(panda):
    """170 impacts: speeds, and phases of the step at touch by way of the speed's last digits."""
    least, worst = np.inf, 0.0
    for speed in np.geomspace(0.02, 0.5, 10):
        for phase in np.arange(17) / 17.0:
            exact = 0.001 / (round(0.001 / (speed * H)) + phase) / H
            rows = panda.hit(exact * DOWN, ticks=150)
            _, _, _, force, ledger, own = rows.T
            assert force.max() > 1.0
            least = min(least, own[-1] / own.max())
            worst = max(worst, abs(own[-1] - ledger[-1]) / own.max())
    assert least > 0.05
    assert worst < 0.05


@pytest.mark.parametrize("velocity", [(0.0, 0.0, -0.05), (0.03, -0.02, -0.25)])
def test_the_force_is_that_of_the_depth_at_any_step(scenario, velocity):
    found = []
    for timestep in (0.001, 0.0005, 0.0001):
        rows = Arm(scenario, timestep, friction=0.2).hit(np.array(velocity), ticks=60)
        found.append((rows[:, 0].max(), rows[:, 3].max(), rows[:, 4].max(), rows[-1, 4]))
    fine = np.array(found[-1])
    assert 0.5 * STIFFNESS * fine[0] ** 2 < fine[2]
    np.testing.assert_allclose(found[0], fine, rtol=0.06)
    np.testing.assert_allclose(found[1], fine, rtol=0.03)


def test_the_tip_s_sensor_has_the_wall_s_force_alone(scenario, panda):
    """Pushed out of the wall, and by nobody else: not by payload, hand or a push on the wrist."""
    others = [
        PayloadConfig(mass_kg=0.5),
        GuidingHandConfig(start_s=0.0, travel_m=(0.0, 0.0, -0.1), duration_s=0.2),
        PushConfig(at="wrist", force_n=(3.0, 4.0, 5.0), start_s=0.0),
    ]
    busy = Arm(scenario, disturbances=others)
    for arm in (panda, busy):
        rows = arm.hit(0.1 * DOWN, ticks=60)
        depth, force = rows[:, 0], rows[:, 1:4]
        assert force[:, 2].max() > 5.0
        np.testing.assert_allclose(force[:, :2], 0.0, atol=1e-6)
        late = np.flatnonzero(depth > 0.0)[1:-1]
        rate = np.diff(depth, prepend=depth[0]) / H  # of the step that led there
        expected = STIFFNESS * (depth + 0.2 * H * rate) + DAMPING * np.minimum(1.0, depth / 5e-4) * rate
        np.testing.assert_allclose(force[late + 1, 2], expected[late], rtol=2e-3, atol=0.02)


def test_what_cannot_be_stepped_or_has_no_direction_is_refused(scenario):
    prepare(scenario(stiffness_n_per_m=99999.0))
    with pytest.raises(
        SurgsimError, match=r"prop 'contact_wall': k h\^2 \+ b h must be at most 0\.2 kg with "
    ):
        prepare(scenario(stiffness_n_per_m=110000.0))
    prepare(scenario(timestep=0.0005, stiffness_n_per_m=110000.0))
    with pytest.raises(SurgsimError, match=r"friction's damping b 100 and simulation\.timestep_s h 0\.001"):
        prepare(scenario(stiffness_n_per_m=110000.0, damping_n_s_per_m=0.0, friction=0.1))
    with pytest.raises(ScenarioError, match="normal must not be zero"):
        load_scenario("teleop_wall_panda", assignments=("props.0.normal=[0.0, 0.0, 0.0]",))
