"""A one-way packet channel with delay, jitter, loss and duplication, and its energy account.

The packets under way are rows of a ring in the memory, in order of arrival: the time of arrival, the packet's
number, the time at which it was sent, its energy, and the message. What is random about a packet does not
depend on what is in it, so it is drawn ahead, a row for each packet.
"""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, model_validator

from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.teleop.messages import CONTENT
from surgsim.tick.arrays import Array, Record

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


class ChannelConfig(PartConfig):
    """One direction of the channel.

    A packet arrives delay_s + J after it was sent, J ~ Gamma(shape 2, scale jitter_s / sqrt 2): never
    negative, standard deviation jitter_s, mean sqrt(2) jitter_s. Jitter above the sending period
    reorders packets.

    Losses come singly if `burst_packets` is 1; else in runs of that mean length (Gilbert's two-state
    model, Bell Syst. Tech. J. 39, 1960), at the same mean loss.

    `energy`: in mode `power` a packet carries the energy of its own period, P(t) T, and a lost packet
    loses it (passive); in mode `cumulative` it carries the total ever sent, so the next packet brings
    what a lost one did not.
    """

    delay_s: NonNegativeFloat = 0.15
    jitter_s: NonNegativeFloat = 0.0
    loss: Probability = 0.0
    burst_packets: Annotated[float, Field(ge=1.0)] = 1.0
    duplicate: Probability = 0.0
    energy: EnergyMode = "power"

    @model_validator(mode="after")
    def _bursts_are_possible(self) -> "ChannelConfig":
        if self.burst_packets > 1.0 and self.loss > self.burst_packets * (1.0 - self.loss):
            raise ValueError(
                f"a loss of {self.loss:g} needs bursts of more than {self.burst_packets:g} packets: "
                "the mean burst is at least loss / (1 - loss)"
            )
        return self

    def life(self, period_s: float, most: int) -> int:
        """How many periods a packet may be under way, at most `most`."""
        longest = self.delay_s + _LONGEST_JITTER * self.jitter_s / math.sqrt(2.0)
        return math.ceil(min(longest / period_s, most)) + 2


class ChannelLaw(Record):
    """Numbers of a direction.

    Attributes:
        delay_s: Delay without jitter [s].
        cumulative: Whether a packet carries the total ever sent.
        ring: Where in the memory the packets' rows begin.
        capacity: How many rows; a packet that finds no room is lost.
        draws: Where in the memory the rows of draws begin.
    """

    delay_s: float
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
        in_burst: Whether the draws are within a burst of losses.
        sent_j: Energy ever sent [J].
        lost_j: Energy lost [J].
        lost_packets: Packets lost.
    """

    first: int
    count: int
    next_number: int
    drawn: int
    in_burst: int
    sent_j: float
    lost_j: float
    lost_packets: int


def draw_packets(config: ChannelConfig, channel: Channel, rng: np.random.Generator, rows: Array) -> None:
    """Draw what happens to the coming packets (k, 3), see `LOST` and the following."""
    scale = config.jitter_s / np.sqrt(2.0)

    def extra() -> float:
        late = scale * rng.standard_gamma(2.0) if config.jitter_s else 0.0
        return float(min(late, _LONGEST_JITTER * scale))

    rows[:, LOST], rows[:, EXTRA], rows[:, COPY] = 0.0, 0.0, -1.0
    if not (config.jitter_s or config.loss or config.duplicate):
        return
    for row in rows:
        if config.loss and _is_lost(config, channel, rng):
            row[LOST] = 1.0
            continue
        row[EXTRA] = extra()
        if config.duplicate and rng.random() < config.duplicate:
            row[COPY] = extra()


def _is_lost(config: ChannelConfig, channel: Channel, rng: np.random.Generator) -> bool:
    loss, burst = config.loss, config.burst_packets
    if burst == 1.0:
        return bool(rng.random() < loss)
    likely = 1.0 - 1.0 / burst if channel.in_burst else loss / (burst * (1.0 - loss))
    channel.in_burst = rng.random() < likely
    return bool(channel.in_burst)


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
            memory[at + NUMBER], memory[at + SENT], memory[at + ENERGY] = number, t_s, carried
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
