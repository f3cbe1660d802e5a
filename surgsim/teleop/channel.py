"""A one-way packet channel with delay, jitter, loss, duplication and clocks, and its energy account.

The packets under way are rows of a ring in the memory, in order of arrival: the time of arrival, the packet's
number, the time at which it was sent, its energy, and the message. What is random about a packet does not
depend on what is in it, so it is drawn ahead, a row for each packet.
"""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, FiniteFloat, NonNegativeFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.teleop.messages import CONTENT
from surgsim.teleop.networks import NETWORKS, NetworkName
from surgsim.teleop.recorded import read_delays
from surgsim.tick.arrays import Record

Probability = Annotated[float, Field(ge=0.0, lt=1.0)]
EnergyMode = Literal["power", "cumulative"]
_SAME_TIME_S = 1e-9
_LONGEST_JITTER = 40.0
"""Cut of the gamma law in units of its scale: one packet in 6e15 would be later."""
ARRIVAL, NUMBER, SENT, ENERGY, MESSAGE = range(5)
PACKET = MESSAGE + CONTENT
"""Places in a packet's row, and its length."""
LOST, EXTRA, COPY, DRAW = range(4)
"""Places in a row of draws, and its length: 1 if lost; delay beyond delay_s [s]; that of a copy, or -1."""


class JumpConfig(PartConfig):
    """From `at_s` on a packet takes `delay_s`."""

    at_s: NonNegativeFloat
    delay_s: NonNegativeFloat


class ChannelConfig(PartConfig):
    """One direction of the channel.

    A packet arrives delay_s + J after it was sent, J ~ Gamma(shape 2, scale jitter_s / sqrt 2): never
    negative, standard deviation jitter_s, mean sqrt(2) jitter_s. Jitter above the sending period
    reorders packets.

    Losses come singly if `burst_packets` is 1; else in bursts of that mean length, in which a packet is lost
    with the probability `burst_loss` (the two-state model of Gilbert, Bell Syst. Tech. J. 39, 1960, and
    Elliott, 42, 1963), at the same mean loss.

    From the time of each of `jumps` on the delay is another. `trace` is a recorded network: a CSV file whose
    column `delay_s` has the delay of every packet, empty where it was lost; it begins again at its end, and
    its median is then `delay_s`. `preset` fills in the numbers of a named network
    (`surgsim.teleop.networks`) that are not given.

    The sender's clock reads (1 + drift) t + skew: it stamps the packets with that.

    `energy`: in mode `power` a packet carries the energy of its own period, P(t) T, and a lost packet
    loses it (passive); in mode `cumulative` it carries the total ever sent, so the next packet brings
    what a lost one did not.
    """

    preset: NetworkName | None = None
    delay_s: NonNegativeFloat = 0.15
    jitter_s: NonNegativeFloat = 0.0
    loss: Probability = 0.0
    burst_packets: Annotated[float, Field(ge=1.0)] = 1.0
    burst_loss: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    duplicate: Probability = 0.0
    jumps: tuple[JumpConfig, ...] = ()
    trace: str | None = None
    trace_sha256: str | None = None
    clock_skew_s: FiniteFloat = 0.0
    clock_drift_ppm: FiniteFloat = 0.0
    energy: EnergyMode = "power"

    @model_validator(mode="after")
    def _of_the_network(self) -> "ChannelConfig":
        for key, value in NETWORKS[self.preset].items() if self.preset else ():
            if key not in self.model_fields_set:
                object.__setattr__(self, key, value)  # frozen, but still being made
        return self

    @model_validator(mode="after")
    def _bursts_are_possible(self) -> "ChannelConfig":
        bad = self.loss / self.burst_loss
        if self.burst_packets > 1.0 and (bad >= 1.0 or bad > self.burst_packets * (1.0 - bad)):
            raise ValueError(
                f"a loss of {self.loss:g} needs bursts of more than {self.burst_packets:g} packets: "
                "the mean burst is at least loss / (1 - loss)"
            )
        if self.burst_loss < 1.0 and self.burst_packets == 1.0:
            raise ValueError("burst_loss needs burst_packets above 1")
        return self

    @model_validator(mode="after")
    def _trace_is_there(self) -> "ChannelConfig":
        if self.trace is None:
            if self.trace_sha256 is not None:
                raise ValueError("trace_sha256 needs a trace")
            return self
        idle = ("jitter_s", "loss", "burst_packets", "burst_loss", "jumps", "preset")
        given = [key for key in idle if getattr(self, key) != type(self).model_fields[key].default]
        if given:
            raise ValueError(f"{given[0]} is in the trace: leave one of both out")
        delays, found = read_delays(self.trace)
        if self.trace_sha256 not in (None, found):
            raise ValueError(f"trace {self.trace} is not the file of trace_sha256: it has changed")
        median = float(np.nanmedian(delays))
        if "delay_s" in self.model_fields_set and self.delay_s != median:
            raise ValueError(f"delay_s is {median:g} with this trace, its median: leave it out")
        object.__setattr__(self, "trace_sha256", found)  # frozen, but still being made
        object.__setattr__(self, "delay_s", median)
        return self

    def delays(self, first: int, count: int, period_s: float) -> Array:
        """Delay without jitter of the packets from number `first` on (count,) [s]; NaN: lost in the trace."""
        numbers = np.arange(first, first + count)
        if self.trace is not None:
            recorded = read_delays(self.trace)[0]
            return np.asarray(recorded[numbers % recorded.size])
        found = np.full(count, self.delay_s)
        for jump in sorted(self.jumps, key=lambda jump: jump.at_s):
            found[numbers * period_s >= jump.at_s - _SAME_TIME_S] = jump.delay_s
        return found

    def bounds(self) -> tuple[float, float]:
        """Least and largest delay without jitter [s]."""
        if self.trace is not None:
            recorded = read_delays(self.trace)[0]
            return float(np.nanmin(recorded)), float(np.nanmax(recorded))
        every = (self.delay_s, *(jump.delay_s for jump in self.jumps))
        return min(every), max(every)

    def life(self, period_s: float, most: int) -> int:
        """How many periods a packet may be under way, at most `most`."""
        longest = self.bounds()[1] + _LONGEST_JITTER * self.jitter_s / math.sqrt(2.0)
        return math.ceil(min(longest / period_s, most)) + 2


class ChannelLaw(Record):
    """Numbers of a direction.

    Attributes:
        delay_s: Least delay without jitter [s]; the draws have what a packet takes beyond it.
        clock_rate: What the sender's clock goes in a second.
        clock_skew_s: What it reads at the start [s].
        cumulative: Whether a packet carries the total ever sent.
        ring: Where in the memory the packets' rows begin.
        capacity: How many rows; a packet that finds no room is lost.
        draws: Where in the memory the rows of draws begin.
    """

    delay_s: float
    clock_rate: float
    clock_skew_s: float
    cumulative: int
    ring: int
    capacity: int
    draws: int


class Channel(Record):
    """State of a direction.

    Attributes:
        first: Row of the packet that arrives next.
        count: Packets under way.
        next_number: Number of the next packet.
        drawn: Rows of draws used.
        made: Rows of draws ever made.
        in_burst: Whether the draws are within a burst of losses.
        sent_j: Energy ever sent [J].
        lost_j: Energy lost [J].
        lost_packets: Packets lost.
    """

    first: int
    count: int
    next_number: int
    drawn: int
    made: int
    in_burst: int
    sent_j: float
    lost_j: float
    lost_packets: int


def draw_packets(
    config: ChannelConfig,
    channel: Channel,
    rng: np.random.Generator,
    rows: Array,
    period_s: float = 0.001,
) -> None:
    """Draw what happens to the coming packets (k, 3), one each `period_s`; see `LOST` and the following."""
    base = config.delays(int(channel.made), len(rows), period_s) - config.bounds()[0]
    channel.made += len(rows)
    scale = config.jitter_s / np.sqrt(2.0)

    def extra() -> float:
        late = scale * rng.standard_gamma(2.0) if config.jitter_s else 0.0
        return float(min(late, _LONGEST_JITTER * scale))

    rows[:, LOST], rows[:, COPY] = np.isnan(base), -1.0
    rows[:, EXTRA] = np.nan_to_num(base)
    if not (config.jitter_s or config.loss or config.duplicate):
        return
    for row in rows:
        if config.loss and _is_lost(config, channel, rng):
            row[LOST] = 1.0
            continue
        least = row[EXTRA]
        row[EXTRA] = least + extra()
        if config.duplicate and rng.random() < config.duplicate:
            row[COPY] = least + extra()


def _is_lost(config: ChannelConfig, channel: Channel, rng: np.random.Generator) -> bool:
    loss, burst = config.loss, config.burst_packets
    if burst == 1.0:
        return bool(rng.random() < loss)
    bad = loss / config.burst_loss
    likely = 1.0 - 1.0 / burst if channel.in_burst else bad / (burst * (1.0 - bad))
    channel.in_burst = rng.random() < likely
    if config.burst_loss == 1.0:
        return bool(channel.in_burst)
    return bool(channel.in_burst and rng.random() < config.burst_loss)


@compiled
def send(
    law: ChannelLaw, channel: Channel, memory: Array, t_s: float, content: Array, energy_j: float
) -> None:
    """Send `content` and the energy `energy_j` of this period: no arrival, one, or two."""
    draw = law.draws + DRAW * channel.drawn
    number = channel.next_number
    channel.drawn += 1
    channel.next_number += 1
    channel.sent_j += energy_j
    if memory[draw + LOST] == 1.0 or channel.count >= law.capacity:
        channel.lost_packets += 1
        if not law.cumulative:
            channel.lost_j += energy_j
        return
    carried = channel.sent_j if law.cumulative else energy_j
    for which in (EXTRA, COPY):
        if memory[draw + which] >= 0.0 and channel.count < law.capacity:
            at = _make_room(law, channel, memory, t_s + law.delay_s + memory[draw + which])
            stamp = law.clock_rate * t_s + law.clock_skew_s
            memory[at + NUMBER], memory[at + SENT], memory[at + ENERGY] = number, stamp, carried
            for i in range(CONTENT):
                memory[at + MESSAGE + i] = content[i]


@compiled
def _row(law: ChannelLaw, channel: Channel, k: int) -> int:
    """Where the k-th packet under way is."""
    return law.ring + PACKET * ((channel.first + k) % law.capacity)


@compiled
def _make_room(law: ChannelLaw, channel: Channel, memory: Array, arrival_s: float) -> int:
    """Where a packet that arrives at `arrival_s` goes: behind those that arrive no later."""
    k = channel.count
    at = _row(law, channel, k)
    while k > 0:
        before = _row(law, channel, k - 1)
        if memory[before + ARRIVAL] <= arrival_s:
            break
        for i in range(PACKET):
            memory[at + i] = memory[before + i]
        k, at = k - 1, before
    channel.count += 1
    memory[at + ARRIVAL] = arrival_s
    return at


@compiled
def arrived(law: ChannelLaw, channel: Channel, memory: Array, t_s: float) -> int:
    """Take the next packet that has arrived by `t_s`: where its row is until another is sent, or -1."""
    at = _row(law, channel, 0)
    if channel.count == 0 or memory[at + ARRIVAL] > t_s + _SAME_TIME_S:
        return -1
    channel.first = (channel.first + 1) % law.capacity
    channel.count -= 1
    return at


@compiled
def in_flight(channel: Channel, received_j: float) -> float:
    """Energy under way [J], given what the receiver has counted: sent = received + lost + in flight."""
    return channel.sent_j - channel.lost_j - received_j
