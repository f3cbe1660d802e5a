"""Channel and receiver: energy is never made, order and number of packets do not matter."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from surgsim.teleop.channel import Channel, ChannelConfig, Packet
from surgsim.teleop.receiver import Receiver, ReceiverConfig, fade

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


def send_all(config, energies, seed=0):
    """The channel and its receiver after every period, and (sent, received, in flight, lost) of each."""
    channel, receiver = (
        Channel(config, np.random.default_rng(seed)),
        Receiver(ReceiverConfig(), config.energy),
    )
    rows = []
    for k in range(len(energies) + 400):
        t = k * PERIOD_S
        if k < len(energies):
            channel.send(t, k, energies[k])
        receiver.accept(t, channel.receive(t))
        flight = channel.in_flight_j(receiver.received_j)
        rows.append((channel.sent_j, receiver.received_j, flight, channel.lost_j))
    return channel, receiver, np.array(rows)


@settings(max_examples=60, deadline=None)
@given(
    config=CONFIGS,
    energies=ENERGIES,
    seed=st.integers(0, 1000),
    mode=st.sampled_from(["power", "cumulative"]),
)
def test_energy_received_never_exceeds_energy_sent(config, energies, seed, mode):
    _, _, rows = send_all(config.model_copy(update={"energy": mode}), energies, seed)
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
    channel = Channel(config, np.random.default_rng(seed))
    for k, energy in enumerate(energies):
        channel.send(k * PERIOD_S, k, energy)
    arrived = channel.receive(math.inf)
    there = {packet.sequence for packet in arrived}
    receiver = Receiver(ReceiverConfig())
    assert receiver.accept(1.0, arrived) == pytest.approx(sum(energies[k] for k in there), abs=1e-12)
    assert channel.lost_j == pytest.approx(
        sum(e for k, e in enumerate(energies) if k not in there), abs=1e-12
    )
    assert channel.in_flight_j(receiver.received_j) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("mode", "arrives"), [("power", False), ("cumulative", True)])
def test_a_lost_packet_costs_its_energy_in_power_mode_only(mode, arrives):
    config = ChannelConfig(delay_s=0.0, loss=0.5, energy=mode)
    channel, _, rows = send_all(config, [0.01] * 200, seed=3)
    assert channel.lost_packets > 50
    assert (abs(rows[-1, 1] - 2.0) < 0.05) == arrives
    assert (channel.lost_j == 0.0) == arrives


def test_a_packet_arrives_after_exactly_the_delay():
    channel = Channel(ChannelConfig(delay_s=0.15), np.random.default_rng(0))
    for k in range(400):
        channel.send(k * PERIOD_S, k)
        arrived = channel.receive(k * PERIOD_S)
        assert [packet.content for packet in arrived] == ([k - 150] if k >= 150 else [])


def test_jitter_is_an_extra_delay_of_the_documented_spread_and_reorders():
    config = ChannelConfig(delay_s=0.1, jitter_s=0.01)
    channel, sent = Channel(config, np.random.default_rng(1)), 4000
    for k in range(sent):
        channel.send(k * PERIOD_S, k)
    late, order = [], []
    for k in range(sent + 500):
        for packet in channel.receive(k * PERIOD_S):
            late.append(k * PERIOD_S - packet.sent_s - 0.1)
            order.append(packet.sequence)
    assert len(late) == sent
    assert min(late) > -1e-9
    assert np.std(late) == pytest.approx(0.01, rel=0.1)
    assert np.mean(late) == pytest.approx(0.01 * math.sqrt(2.0), rel=0.1)
    assert order != sorted(order)


@pytest.mark.parametrize("burst", [1.0, 8.0])
def test_losses_have_the_asked_rate_and_run_length(burst):
    config = ChannelConfig(delay_s=0.0, loss=0.1, burst_packets=burst)
    channel = Channel(config, np.random.default_rng(2))
    sent = 60_000
    lost = np.ones(sent, dtype=bool)
    for k in range(sent):
        channel.send(k * PERIOD_S, k)
        lost[[packet.sequence for packet in channel.receive(k * PERIOD_S)]] = False
    runs = np.sum(np.diff(lost.astype(int)) == 1)
    assert lost.mean() == pytest.approx(0.1, rel=0.1)
    assert lost.sum() / runs == pytest.approx(max(burst, 1.0 / 0.9), rel=0.1)


def test_duplicates_are_delivered_twice_and_counted_once():
    channel, receiver, rows = send_all(ChannelConfig(duplicate=0.5, jitter_s=0.005), [0.1] * 300)
    assert 100 < receiver.duplicate_packets < 200
    assert rows[-1, 1] == pytest.approx(channel.sent_j)


def test_the_newest_packet_wins_and_a_late_one_still_pays():
    receiver = Receiver(ReceiverConfig())
    packets = [Packet(sequence=n, sent_s=0.0, energy_j=1.0, content=n) for n in (0, 3, 1, 3, 1, 2)]
    assert receiver.accept(0.0, packets) == 4.0
    assert receiver.newest.content == 3
    assert (receiver.late_packets, receiver.duplicate_packets) == (2, 2)


def test_a_late_packet_does_not_renew_the_trust_in_the_set_point():
    receiver = Receiver(ReceiverConfig(hold_s=0.05, fade_s=0.2))
    assert receiver.trust(0.0) == 0.0
    receiver.accept(0.0, [Packet(sequence=1, sent_s=0.0, energy_j=0.0, content=None)])
    assert receiver.trust(0.05) == 1.0
    receiver.accept(0.06, [Packet(sequence=0, sent_s=0.0, energy_j=0.0, content=None)])
    assert receiver.trust(0.15) == pytest.approx(0.5)
    assert receiver.trust(0.26) == 0.0


def test_fading_has_no_jump_and_no_kink():
    ages = np.linspace(0.0, 0.4, 4001)
    values = np.array([fade(age, ReceiverConfig(hold_s=0.05, fade_s=0.2)) for age in ages])
    assert np.all(np.diff(values) <= 0.0)
    slope = np.diff(values) / np.diff(ages)
    assert np.max(np.abs(np.diff(slope))) < 0.03


def test_a_channel_is_deterministic_under_its_seed():
    config = ChannelConfig(jitter_s=0.01, loss=0.2, duplicate=0.2)
    assert np.array_equal(send_all(config, [0.1] * 50, 7)[2], send_all(config, [0.1] * 50, 7)[2])
    assert not np.array_equal(send_all(config, [0.1] * 50, 7)[2], send_all(config, [0.1] * 50, 8)[2])


def test_a_loss_that_its_bursts_cannot_reach_is_refused():
    with pytest.raises(ValidationError, match=r"a loss of 0\.9 needs bursts of more than 2 packets"):
        ChannelConfig(loss=0.9, burst_packets=2.0)
