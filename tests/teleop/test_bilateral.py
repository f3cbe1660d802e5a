"""Bilateral schemes: each against a formula of its own, between two masses and two constant delays."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import fsolve

from surgsim.errors import SurgsimError
from surgsim.teleop.bilateral import BILATERAL
from surgsim.teleop.bilateral.base import End, compiled_only
from surgsim.teleop.bilateral.follower import FollowerConfig
from surgsim.teleop.bilateral.p_plus_d import PPlusDConfig, enough_damping
from surgsim.teleop.bilateral.passive_set_position import PassiveSetPositionConfig
from surgsim.teleop.bilateral.position_force import PositionForceConfig
from surgsim.teleop.bilateral.position_position import PositionPositionConfig
from surgsim.teleop.bilateral.time_domain import TimeDomainConfig
from surgsim.teleop.bilateral.two_layer import TwoLayerConfig
from surgsim.teleop.bilateral.wave_variables import WaveVariablesConfig
from surgsim.tick.arrays import new

H = 0.001
SCHEMES = [name for name in BILATERAL.names() if name != "passive_convex"]
PASSIVE = ("p_plus_d", "passive_set_position", "two_layer", "wave_variables")


@dataclass(kw_only=True)
class Pair:
    """A handle of 1 kg in a hand, a scheme, and a wall at the other end; the tip goes as it is told.

    `hand` is its stiffness and damping towards a target, which may move; all along x. `lost` are the
    packets that do not arrive, of either direction.
    """

    config: object
    delay_ticks: int = 0
    hand: tuple[float, float] = (540.0, 26.0)
    wall_m: float = math.inf
    wall_n_per_m: float = 2000.0
    mass_kg: float = 1.0
    lost: frozenset[int] = frozenset()

    def run(self, target, ticks=4000, speed=0.0):
        """Signals of `ticks` periods with the hand at `target(t)`; the handle begins with `speed`."""
        scheme = self.config.build(H, 2.0 * H * self.delay_ticks)
        near, far = new(End, 0), new(End, 0)
        memories = [np.zeros(scheme.memory_size) for _ in range(2)]
        forth, back = {}, {}
        handle = tip = v_tip = contact = hand = to_hand = to_wall = 0.0
        rows = []
        for end in (near, far):
            end.period_s, end.trust = H, 1.0
        for k in range(ticks):
            take(near, back.pop(k, None))
            near.mobility_per_kg = 1.0 / self.mass_kg
            near.position[0], near.velocity[0] = handle, speed
            assert scheme.feel(scheme.gains, near, memories[0]) == 0
            force = near.command[0]
            hand = self.hand[0] * (target(H * k) - handle) - self.hand[1] * speed
            before, was = handle, speed
            speed += H / self.mass_kg * (hand + force)
            handle += H * 0.5 * (was + speed)
            near.position[0], near.velocity[0], near.force[0] = handle, speed, hand
            near.work_j = force * (handle - before)
            to_hand += near.work_j
            assert scheme.tell(scheme.gains, near, memories[0]) == 0
            if k not in self.lost:
                forth[k + self.delay_ticks] = near.content.copy(), near.energy_j
            take(far, forth.pop(k, None))
            far.position[0], far.velocity[0], far.force[0] = tip, v_tip, contact
            assert scheme.follow(scheme.gains, far, memories[1]) == 0
            if k not in self.lost:
                back[k + max(self.delay_ticks, 1)] = far.content.copy(), far.energy_j
            v_tip = far.command[0]
            tip += H * v_tip
            to_wall += contact * H * v_tip
            contact = self.wall_n_per_m * max(tip - self.wall_m, 0.0)
            rows.append(
                (handle, tip, force, contact, speed, to_hand, to_wall, hand, near.stored_j, far.stored_j)
            )
        names = ("handle", "tip", "force", "contact", "speed", "to_hand", "to_wall", "hand", "near", "far")
        return dict(zip(names, np.array(rows).T, strict=True))


def take(end, packet):
    """Let a packet arrive, or none."""
    end.fresh, end.received_j = packet is not None, 0.0
    if packet is not None:
        end.known = 1
        end.received[:], end.received_j = packet


def still(_):
    return 0.0


def reach(t):
    """A reach of 40 mm in half a second, minimum jerk, which stays."""
    u = min(t / 0.5, 1.0)
    return 0.04 * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)


def shaking(t):
    return 0.02 * math.sin(2.0 * math.pi * 1.3 * t) + 0.01 * math.sin(2.0 * math.pi * 2.9 * t)


@pytest.mark.parametrize("name", SCHEMES)
def test_the_tip_comes_to_where_the_handle_is(name):
    run = Pair(config=BILATERAL.config(name)(), delay_ticks=20).run(reach, 5000)
    assert run["tip"][-1] == pytest.approx(run["handle"][-1], abs=5e-4)
    assert run["tip"][-1] == pytest.approx(0.04, abs=4e-3)


@pytest.mark.parametrize("delay", [1, 50, 300])
@pytest.mark.parametrize("name", PASSIVE)
def test_what_is_called_passive_gives_no_more_than_it_had(name, delay):
    """Against a wall, in a light grip, whatever the delay: the work at both ports, added up here."""
    pair = Pair(config=BILATERAL.config(name)(), delay_ticks=delay, hand=(200.0, 8.0), wall_m=0.001)
    run = pair.run(shaking, 4000)
    stored = run["near"][0] + run["far"][0] + (2e-3 if name == "two_layer" else 0.0)  # sent at once
    assert (run["to_hand"] + run["to_wall"]).max() <= stored + 2e-4
    assert run["contact"].max() > 0.05


def test_reflected_force_is_not_passive():
    """The delayed force of the wall drives the handle; what it is, is what was measured."""
    pair = Pair(config=PositionForceConfig(), delay_ticks=150, hand=(80.0, 4.0), wall_m=0.01)
    run = pair.run(shaking, 4000)
    assert (run["to_hand"] + run["to_wall"]).max() > 0.05
    np.testing.assert_allclose(run["force"][151:], -run["contact"][:-151])


def test_passivity_control_takes_most_of_what_its_network_would_give():
    """A damper needs motion: with a period of its own delay it lets some energy out, as published."""
    off = {"damping_limit_ns_per_m": 1e-9, "mobility_limit_m_per_ns": 1e-9}
    most = {}
    for name, limits in (("off", off), ("on", {})):
        config = TimeDomainConfig(**limits)
        pair = Pair(config=config, delay_ticks=150, hand=(80.0, 4.0), wall_m=0.01)
        run = pair.run(shaking, 4000)
        most[name] = (run["to_hand"] + run["to_wall"]).max()
    assert most["off"] > 0.1
    assert most["on"] < 0.2 * most["off"]


def roots_of(m, mass, K, b, delay_s):
    """Exponents of P+d between free masses, by its characteristic equation.

    (m s^2 + b s + K) (M s^2 + b s + K) = K^2 exp(-s T)
    """

    def residual(parts):
        s = complex(*parts)
        left = (m * s * s + b * s + K) * (mass * s * s + b * s + K) - K * K * np.exp(-s * delay_s)
        return left.real, left.imag

    found = []
    for guess in ((g, w) for g in (-3.0, 0.0, 2.0) for w in range(2, 40, 3)):
        root, _, flag, _ = fsolve(residual, guess, full_output=True)
        if flag == 1 and abs(complex(*root)) > 1e-3:
            found.append(root[0])
    return found


@pytest.mark.parametrize(("share", "stable"), [(1.2, True), (0.2, False)])
def test_p_plus_d_is_stable_where_its_condition_holds_and_grows_as_its_equation_says(share, stable):
    """Free masses of 1 and 2 kg, no hand: 4 B^2 > (T1 + T2)^2 K^2 with and without."""
    K, ticks = 400.0, 100
    total = 2 * H * ticks
    b = share * enough_damping(K, total)
    assert (4.0 * b * b > total**2 * K * K) == stable
    follower = FollowerConfig(mass_kg=2.0, damping_ns_per_m=0.0)
    config = PPlusDConfig(stiffness_n_per_m=K, damping_ns_per_m=b, follower=follower)
    run = Pair(config=config, delay_ticks=ticks, hand=(0.0, 0.0)).run(still, 6000, speed=0.01)
    apart = np.abs(run["handle"] - run["tip"])[2000:].reshape(2, 2000).max(axis=1)
    grows = math.log(apart[1] / apart[0]) / 2.0
    exact = max(roots_of(1.0, 2.0, K, b, total))
    assert (exact > 0.0) == (not stable)
    if stable:
        assert grows < 0.0
    else:
        assert grows == pytest.approx(exact, rel=0.1)


@pytest.mark.parametrize("name", [name for name in SCHEMES if name != "position_force"])
def test_in_static_contact_the_force_at_either_end_is_the_formula_s(name):
    """A hand that presses through no delay: what it feels is what the scheme says of contact and gap."""
    run = Pair(config=BILATERAL.config(name)(), wall_m=0.01, delay_ticks=1).run(lambda t: 0.03, 5000)
    gap, contact, felt = (run[key][-1] for key in ("handle", "contact", "force"))
    gap -= run["tip"][-1]
    assert abs(run["speed"][-500:]).max() < 1e-3
    assert felt == pytest.approx(-run["hand"][-1], abs=0.05)
    config = BILATERAL.config(name)()
    if name == "four_channel":
        assert felt == pytest.approx(-config.stiffness_n_per_m * gap - contact, rel=0.01)
        assert contact == pytest.approx(config.stiffness_n_per_m * gap + run["hand"][-1], rel=0.02)
    elif name in ("position_position", "p_plus_d"):
        assert felt == pytest.approx(-config.stiffness_n_per_m * gap, rel=0.01)
        assert contact == pytest.approx(-felt, rel=0.01)
    elif name == "wave_variables":
        assert contact == pytest.approx(-felt, rel=0.02)
    else:
        assert contact > 0.0


def test_waves_through_a_constant_delay_are_what_was_sent_and_carry_their_energy():
    """The channel holds what the waves under way carry, never less than nothing."""
    b, delay = 30.0, 40
    config = WaveVariablesConfig(impedance_ns_per_m=b, catch_up_s=H)
    scheme = config.build(H, 2 * H * delay)
    near, far = new(End, 0), new(End, 0)
    for end in (near, far):
        end.period_s, end.trust = H, 1.0
    memories = [np.zeros(scheme.memory_size) for _ in range(2)]
    sent, entered, carried, left, x, v = [], 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(600):
        if k >= delay:
            far.known, far.fresh = 1, 1
            far.received[:], far.received_j = sent[k - delay]
        near.position[0], near.velocity[0] = x, v
        scheme.feel(scheme.gains, near, memories[0])
        v = 0.05 * math.sin(12.0 * H * k)
        x += H * v
        near.position[0], near.work_j = x, near.command[0] * H * v
        scheme.tell(scheme.gains, near, memories[0])
        sent.append((near.content.copy(), near.energy_j))
        entered -= near.work_j
        left += far.received_j
        scheme.follow(scheme.gains, far, memories[1])
        assert entered - left >= -1e-12
        carried += near.energy_j
        assert carried == pytest.approx(entered, abs=1e-7)
    u = np.diff([message[3] for message, _ in sent]) / H
    exact = math.sqrt(2.0 * b) * 0.05 * np.sin(12.0 * H * np.arange(1, 600))
    np.testing.assert_allclose(u, exact, atol=2e-3)


def test_waves_whose_packets_are_lost_take_no_energy_from_the_channel():
    lost = frozenset(np.flatnonzero(np.random.default_rng(1).random(6000) < 0.4).tolist())
    pair = Pair(config=WaveVariablesConfig(), delay_ticks=60, hand=(80.0, 4.0), wall_m=0.01, lost=lost)
    run = pair.run(shaking, 6000)
    assert (run["to_hand"] + run["to_wall"]).max() <= 1e-4


def test_a_set_position_never_takes_more_than_its_stock():
    """K |x* - x|^2 / 2 rises by what leaves the stock; a stock that is empty moves no tip."""
    empty = PassiveSetPositionConfig(initial_j=0.0, damping_ns_per_m=0.0)
    run = Pair(config=empty, delay_ticks=20).run(reach, 2000)
    assert np.abs(run["tip"]).max() < 1e-9
    run = Pair(config=PassiveSetPositionConfig(), delay_ticks=100, hand=(80.0, 4.0)).run(shaking, 6000)
    assert min(run["near"].min(), run["far"].min()) >= 0.0


def test_two_layers_pay_for_every_force_and_refill_by_the_hand():
    run = Pair(config=TwoLayerConfig(initial_j=0.0), delay_ticks=20).run(reach, 6000)
    assert run["near"][0] == run["far"][0] == 0.0
    assert run["near"].max() > 0.005
    assert min(run["near"].min(), run["far"].min()) >= 0.0


def test_kernels_that_are_not_compiled_are_refused():
    config = PositionPositionConfig().build(H, 0.0)
    with pytest.raises(SurgsimError, match="'feel' must be compiled"):
        compiled_only(config.feel.py_func, "feel")
