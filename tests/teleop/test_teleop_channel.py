"""Channel and receiver: energy is never made, order and number of packets do not matter."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from surgsim.teleop.channel import (
    DRAW,
    MESSAGE,
    NUMBER,
    PACKET,
    SENT,
    Channel,
    ChannelConfig,
    ChannelLaw,
    arrived,
    draw_packets,
    in_flight,
    send,
)
from surgsim.teleop.messages import CONTENT
from surgsim.teleop.receiver import Receiver, ReceiverConfig, ReceiverLaw, accept, expect, fade, trust
from surgsim.tick.arrays import new
from surgsim.tick.overlay import take

PERIOD_S = 0.001
CONFIGS = st.builds(
    ChannelConfig,
    delay_s=st.sampled_from([0.0, 0.01, 0.15]),
    jitter_s=st.sampled_from([0.0, 0.002, 0.02]),
    loss=st.sampled_from([0.0, 0.1, 0.5]),
    burst_packets=st.sampled_from([1.0, 5.0]),
    duplicate=st.sampled_from([0.0, 0.3]),
)
ENERGIES = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=80)


class Link:
    """A channel for up to `most` packets and its receiver; packets taken are (number, sent, content)."""

    def __init__(self, config, seed=0, most=500, receiver=None, window=None):
        self.law, self.channel = new(ChannelLaw, 0), new(Channel, 0)
        self.end, self.got = new(ReceiverLaw, 0), new(Receiver, 0)
        take(self.law, config)
        self.law.clock_rate = 1.0
        take(self.end, receiver or ReceiverConfig())
        window = window or most
        self.law.capacity, self.law.draws, self.law.ring = 2 * most, window, window + DRAW * most
        self.law.cumulative = self.end.cumulative = config.energy == "cumulative"
        self.end.window = window
        self.memory = np.zeros(window + DRAW * most + 2 * PACKET * most)
        draws = self.memory[window : window + DRAW * most].reshape(-1, DRAW)
        draw_packets(config, self.channel, np.random.default_rng(seed), draws)
        expect(self.end, self.got, self.memory)

    def send(self, t, content, energy=0.0):
        send(self.law, self.channel, self.memory, t, np.full(CONTENT, float(content)), energy)

    def receive(self, t):
        """Take packets from the channel, and hand them to the receiver."""
        taken = []
        at = arrived(self.law, self.channel, self.memory, t)
        while at >= 0:
            row = self.memory[at : at + PACKET]
            taken.append((int(row[NUMBER]), float(row[SENT]), float(row[MESSAGE])))
            accept(self.end, self.got, self.memory, at, min(t, 1e3))
            at = arrived(self.law, self.channel, self.memory, t)
        return taken

    def hand_over(self, t, number, content=0.0, energy=0.0):
        """Give the receiver a packet that no channel brought."""
        row = np.array([t, number, t, energy, *[content] * CONTENT])
        at = self.law.ring
        self.memory[at : at + PACKET] = row
        accept(self.end, self.got, self.memory, at, t)

    @property
    def flight_j(self):
        return in_flight(self.channel, self.got.received_j)


def send_all(config, energies, seed=0):
    """The link after every period, and (sent, received, in flight, lost) of each."""
    link, rows = Link(config, seed), []
    for k in range(len(energies) + 400):
        t = k * PERIOD_S
        if k < len(energies):
            link.send(t, k, energies[k])
        link.receive(t)
        rows.append((link.channel.sent_j, link.got.received_j, link.flight_j, link.channel.lost_j))
    return link, np.array(rows)


@settings(max_examples=60, deadline=None)
@given(
    config=CONFIGS,
    energies=ENERGIES,
    seed=st.integers(0, 1000),
    mode=st.sampled_from(["power", "cumulative"]),
)
def test_energy_received_never_exceeds_energy_sent(config, energies, seed, mode):
    _, rows = send_all(config.model_copy(update={"energy": mode}), energies, seed)
    sent, received, flight, lost = rows.T
    slack = 1e-12 * len(energies)
    assert np.all(received <= sent + slack)
    assert np.all(np.diff(received) >= 0.0)
    assert np.all(flight >= -slack)
    assert np.all(lost <= sent + slack)


@settings(max_examples=40, deadline=None)
@given(config=CONFIGS, energies=ENERGIES, seed=st.integers(0, 1000))
def test_once_the_queue_is_empty_all_that_was_sent_is_received_or_lost(config, energies, seed):
    """Independent of the account: the losses are seen in the sequence numbers that arrived."""
    link = Link(config, seed)
    for k, energy in enumerate(energies):
        link.send(k * PERIOD_S, k, energy)
    there = {number for number, _, _ in link.receive(math.inf)}
    assert link.got.received_j == pytest.approx(sum(energies[k] for k in there), abs=1e-12)
    lost = sum(e for k, e in enumerate(energies) if k not in there)
    assert link.channel.lost_j == pytest.approx(lost, abs=1e-12)
    assert link.flight_j == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("mode", "arrives"), [("power", False), ("cumulative", True)])
def test_a_lost_packet_costs_its_energy_in_power_mode_only(mode, arrives):
    config = ChannelConfig(delay_s=0.0, loss=0.5, energy=mode)
    link, rows = send_all(config, [0.01] * 200, seed=3)
    assert link.channel.lost_packets > 50
    assert (abs(rows[-1, 1] - 2.0) < 0.05) == arrives
    assert (link.channel.lost_j == 0.0) == arrives


def test_a_packet_arrives_after_exactly_the_delay():
    link = Link(ChannelConfig(delay_s=0.15))
    for k in range(400):
        link.send(k * PERIOD_S, k)
        taken = [content for _, _, content in link.receive(k * PERIOD_S)]
        assert taken == ([k - 150] if k >= 150 else [])


def test_jitter_is_an_extra_delay_of_the_documented_spread_and_reorders():
    config = ChannelConfig(delay_s=0.1, jitter_s=0.01)
    sent = 4000
    link = Link(config, seed=1, most=sent)
    for k in range(sent):
        link.send(k * PERIOD_S, k)
    late, order = [], []
    for k in range(sent + 500):
        for number, sent_s, _ in link.receive(k * PERIOD_S):
            late.append(k * PERIOD_S - sent_s - 0.1)
            order.append(number)
    assert len(late) == sent
    assert min(late) > -1e-9
    assert np.std(late) == pytest.approx(0.01, rel=0.1)
    assert np.mean(late) == pytest.approx(0.01 * math.sqrt(2.0), rel=0.1)
    assert order != sorted(order)


@pytest.mark.parametrize("burst", [1.0, 8.0])
def test_losses_have_the_asked_rate_and_run_length(burst):
    config = ChannelConfig(delay_s=0.0, loss=0.1, burst_packets=burst)
    sent = 60_000
    link = Link(config, seed=2, most=sent)
    lost = np.ones(sent, dtype=bool)
    for k in range(sent):
        link.send(k * PERIOD_S, k)
        lost[[number for number, _, _ in link.receive(k * PERIOD_S)]] = False
    runs = np.sum(np.diff(lost.astype(int)) == 1)
    assert lost.mean() == pytest.approx(0.1, rel=0.1)
    assert lost.sum() / runs == pytest.approx(max(burst, 1.0 / 0.9), rel=0.1)


def test_duplicates_are_delivered_twice_and_counted_once():
    link, rows = send_all(ChannelConfig(duplicate=0.5, jitter_s=0.005), [0.1] * 300)
    assert 100 < link.got.duplicate_packets < 200
    assert rows[-1, 1] == pytest.approx(link.channel.sent_j)


def test_the_newest_packet_wins_and_a_late_one_still_pays():
    link = Link(ChannelConfig())
    for number in (0, 3, 1, 3, 1, 2):
        link.hand_over(0.0, number, content=float(number), energy=1.0)
    assert link.got.received_j == 4.0
    assert link.got.content[0] == 3.0
    assert (link.got.late_packets, link.got.duplicate_packets) == (2, 2)


def test_a_late_packet_does_not_renew_the_trust_in_the_set_point():
    link = Link(ChannelConfig(), receiver=ReceiverConfig(hold_s=0.05, fade_s=0.2))
    assert trust(link.end, link.got, 0.0) == 0.0
    link.hand_over(0.0, 1)
    assert trust(link.end, link.got, 0.05) == 1.0
    link.hand_over(0.06, 0)
    assert trust(link.end, link.got, 0.15) == pytest.approx(0.5)
    assert trust(link.end, link.got, 0.26) == 0.0


@pytest.mark.parametrize("burst", [1.0, 20.0])
def test_a_window_of_a_packet_s_life_tells_late_from_duplicate_as_all_numbers_would(burst):
    config = ChannelConfig(delay_s=0.02, jitter_s=0.01, loss=0.3, burst_packets=burst, duplicate=0.4)
    sent, life = 3000, config.life(PERIOD_S, 10**6)
    assert life < 400
    links = [Link(config, seed=4, most=sent, window=window) for window in (life, sent)]
    there, late, again, highest = set(), 0, 0, -1
    for k in range(sent + 400):
        for link in links:
            if k < sent:
                link.send(k * PERIOD_S, k, 1.0)
        taken, same = (link.receive(k * PERIOD_S) for link in links)
        assert taken == same
        for number, _, _ in taken:
            again += number in there
            late += number not in there and number < highest
            there.add(number)
            highest = max(highest, number)
    for link in links:
        assert (link.got.late_packets, link.got.duplicate_packets) == (late, again)
        assert link.got.received_j == len(there)
    assert min(late, again) > 200


def test_a_packet_that_finds_no_room_is_lost_and_booked():
    link = Link(ChannelConfig(delay_s=1.0), most=4)
    link.law.capacity = 3
    for k in range(4):
        link.send(k * PERIOD_S, k, 0.5)
    assert [number for number, _, _ in link.receive(math.inf)] == [0, 1, 2]
    assert (link.channel.lost_packets, link.channel.lost_j) == (1, 0.5)
    assert link.flight_j == 0.0


def test_fading_has_no_jump_and_no_kink():
    ages = np.linspace(0.0, 0.4, 4001)
    values = np.array([fade(age, 0.05, 0.2) for age in ages])
    assert np.all(np.diff(values) <= 0.0)
    slope = np.diff(values) / np.diff(ages)
    assert np.max(np.abs(np.diff(slope))) < 0.03


def test_a_channel_is_deterministic_under_its_seed():
    config = ChannelConfig(jitter_s=0.01, loss=0.2, duplicate=0.2)
    assert np.array_equal(send_all(config, [0.1] * 50, 7)[1], send_all(config, [0.1] * 50, 7)[1])
    assert not np.array_equal(send_all(config, [0.1] * 50, 7)[1], send_all(config, [0.1] * 50, 8)[1])


def test_a_loss_that_its_bursts_cannot_reach_is_refused():
    with pytest.raises(ValidationError, match=r"a loss of 0\.9 needs bursts of more than 2 packets"):
        ChannelConfig(loss=0.9, burst_packets=2.0)
