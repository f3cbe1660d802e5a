"""Channels as networks: presets, jumps, bursts, traces, clocks, and the picture's own way."""

import json

import numpy as np
import pytest
from pydantic import ValidationError

from surgsim.errors import SurgsimError
from surgsim.live.session import LatePicture
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare
from surgsim.tasks.teleoperation import TeleoperationConfig
from surgsim.teleop.channel import COPY, EXTRA, LOST, Channel, ChannelConfig, JumpConfig, draw_packets
from surgsim.teleop.hand import HandCommand
from surgsim.teleop.networks import NETWORKS
from surgsim.tick.arrays import new

H = 0.001


def drawn(config, count=5000, seed=3):
    """Delays (count,) [s] of packets, NaN for those that are lost."""
    rows, channel = np.empty((count, 3)), new(Channel, 0)
    random = np.random.default_rng(seed)
    for begin in range(0, count, 1000):
        draw_packets(config, channel, random, rows[begin : begin + 1000], H)
    delays = config.bounds()[0] + rows[:, EXTRA]
    delays[rows[:, LOST] == 1.0] = np.nan
    assert (rows[:, COPY] < 0.0).all() or config.duplicate > 0.0
    return delays


def test_a_preset_fills_in_what_is_not_given():
    config = ChannelConfig(preset="geo_satellite", loss=0.2)
    assert (config.delay_s, config.jitter_s, config.loss) == (0.279, 0.002, 0.2)
    assert ChannelConfig(**config.model_dump()) == config
    for name, numbers in NETWORKS.items():
        assert ChannelConfig(preset=name).model_dump().items() >= numbers.items()
    with pytest.raises(ValidationError, match="geo_satellite"):
        ChannelConfig(preset="pigeon")


def test_the_delay_jumps_when_it_is_told_to():
    jumps = (JumpConfig(at_s=3.0, delay_s=0.2), JumpConfig(at_s=1.0, delay_s=0.02))
    delays = drawn(ChannelConfig(delay_s=0.1, jumps=jumps))
    expected = np.select([np.arange(5000) < 1000, np.arange(5000) < 3000], [0.1, 0.02], 0.2)
    np.testing.assert_allclose(delays, expected)


def test_losses_come_in_bursts_of_their_length_at_their_share():
    """Gilbert and Elliott: mean loss and mean length of the bad state, by their own count."""
    config = ChannelConfig(loss=0.1, burst_packets=20.0, burst_loss=0.5)
    lost = np.isnan(drawn(config, 200_000))
    assert lost.mean() == pytest.approx(0.1, rel=0.1)
    near = np.mean(lost[1:][lost[:-1]])  # after a loss: still in the burst, and lost again
    assert near == pytest.approx(0.5 * (1.0 - 1.0 / 20.0), rel=0.05)


def test_a_recorded_network_is_played_packet_by_packet_and_again(tmp_path):
    file = tmp_path / "net.csv"
    file.write_text("t_s,delay_s\n0,0.010\n0.001,\n0.002,0.030\n0.003,0.020\n")
    config = ChannelConfig(trace=str(file))
    assert config.delay_s == 0.020
    np.testing.assert_allclose(drawn(config, 1001)[:9], [0.01, np.nan, 0.03, 0.02] * 2 + [0.01])
    again = ChannelConfig(**config.model_dump())
    assert again == config
    file.write_text("delay_s\n0.011\n")
    with pytest.raises(ValidationError, match="it has changed"):
        ChannelConfig(trace=str(file), trace_sha256=config.trace_sha256)


@pytest.mark.parametrize(
    ("text", "keys", "reason"),
    [
        ("delay_s\n0.01\nsoon\n", {}, "line 3: 'soon' is no delay in seconds"),
        ("delay_s\n90\n", {}, "line 2: a delay of 90 s is not from 0 to 60"),
        ("delay_s\n\n", {}, "has no column delay_s with rows"),
        ("wait\n0.1\n", {}, "has no column delay_s with rows"),
        ("delay_s,t\n,1\n", {}, "has lost packets alone"),
        ("delay_s\n0.01\n", {"loss": 0.1}, "loss is in the trace"),
        ("delay_s\n0.01\n", {"delay_s": 0.2}, "delay_s is 0.01 with this trace"),
    ],
)
def test_what_is_wrong_with_a_trace_is_said(tmp_path, text, keys, reason):
    (tmp_path / "net.csv").write_text(text)
    with pytest.raises(ValidationError, match=reason):
        ChannelConfig(trace=str(tmp_path / "net.csv"), **keys)


def test_a_trace_lies_beside_its_scenario(tmp_path):
    (tmp_path / "net.csv").write_text("delay_s\n0.03\n")
    shipped = load_scenario("teleop_free_motion_panda").resolved()
    shipped["task"]["channel"] = {"trace": "net.csv"}

    (tmp_path / "mine.yaml").write_text(json.dumps(shipped))
    scenario = load_scenario(str(tmp_path / "mine.yaml"))
    assert scenario.task.channel.delay_s == 0.03
    assert scenario.task.channel.trace == str(tmp_path / "net.csv")
    shipped["task"]["channel"] = {"trace": "none.csv"}
    (tmp_path / "mine.yaml").write_text(json.dumps(shipped))
    with pytest.raises(SurgsimError, match=r"none\.csv cannot be read: No such file"):
        load_scenario(str(tmp_path / "mine.yaml"))


def test_the_content_of_a_trace_counts_for_the_hash_and_not_its_folder(tmp_path):
    hashes = []
    for name, delays in (("a", "0.1\n0.12"), ("b", "0.1\n0.12"), ("c", "0.12\n0.1")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "net.csv").write_text(f"delay_s\n{delays}\n", encoding="utf-8")
        content = load_scenario("teleop_wall_panda").resolved()
        content["task"]["channel"] = {"trace": str(tmp_path / name / "net.csv")}
        hashes.append(load_scenario(content).sha256())
    assert hashes[0] == hashes[1] != hashes[2]


class Watching:
    """Moves the handle, and writes down what the screen shows it."""

    def __init__(self):
        self.seen = []

    def step(self, t_s, seen_tip, handle):
        self.seen.append(seen_tip[2])
        wrench = np.zeros(6)
        wrench[2] = -1.0
        return HandCommand(wrench=wrench, jaw=0.0, goal=0, done=False, missed=0)


def watched(*settings, ticks=900):
    """A simulation whose hand pulls, its hand, and what a late picture showed: (time, joints) rows."""
    setup = prepare(load_scenario("teleop_free_motion_panda", assignments=["theatre=false", *settings]))
    hand = Watching()
    setup.task.hold(hand)
    simulation, late, shown = Simulation(setup), LatePicture(setup), []
    while simulation.rows < ticks:
        late.remember(simulation.rows)
        for _ in range(10):
            simulation.tick()
        shown.append((simulation.rows, late.delivered().q.copy()))
    return simulation.trace(), hand, shown


@pytest.mark.parametrize(
    ("settings", "delay"),
    [
        (("task.channel={delay_s: 0.12}",), 120),
        (("task.channel={delay_s: 0.05}", "task.video={delay_s: 0.3}"), 300),
        (("task.channel={delay_s: 0.12}", "task.channel_back={delay_s: 0.04}"), 40),
    ],
)
def test_the_picture_at_t_is_the_state_of_t_less_the_delay(settings, delay):
    trace, hand, shown = watched(*settings)
    tip, q = trace["tip_z_m"], trace.block("q")
    assert np.ptp(tip) > 1e-3
    np.testing.assert_allclose(hand.seen[delay + 1 : 800], tip[1 : 800 - delay], atol=1e-12)
    np.testing.assert_allclose(hand.seen[: delay - 1], tip[0], atol=1e-9)
    for tick, joints in shown:
        frame = max((tick - delay) // 10 * 10, 0)  # pictures are taken every ten ticks here
        np.testing.assert_allclose(joints, q[frame], rtol=0.0, atol=1e-9)


def test_a_sender_s_clock_changes_what_the_receiver_believes_and_nothing_else():
    short = ("theatre=false", "task.duration_s=0.4")
    clock = "task.channel={delay_s: 0.1, clock_skew_s: 0.02, clock_drift_ppm: 1000.0}"
    plain, skewed = (
        simulate(load_scenario("teleop_free_motion_panda", assignments=[*short, channel]))
        for channel in ("task.channel={delay_s: 0.1}", clock)
    )
    np.testing.assert_array_equal(plain["tip_x_m"], skewed["tip_x_m"])
    late = plain["setpoint_age_s"] - skewed["setpoint_age_s"]
    sent = plain["t_s"] - plain["setpoint_age_s"]
    known = np.isfinite(late)
    np.testing.assert_allclose(late[known], 0.02 + 1e-3 * sent[known], atol=1e-9)


def test_the_channels_need_not_be_alike():
    config = TeleoperationConfig(channel=ChannelConfig(preset="4g"), video=ChannelConfig(preset="5g"))
    task = config.build(np.zeros(3), H)
    task.command(0.0)
    assert task.picture_tick == -1
