"""A one-way packet channel with delay, jitter, loss and duplication, and its energy account."""

import heapq
import itertools
from dataclasses import dataclass
from typing import Annotated, Generic, Literal, TypeVar

import numpy as np
from pydantic import Field, NonNegativeFloat, model_validator

from surgsim.catalog import PartConfig

Content = TypeVar("Content")
Probability = Annotated[float, Field(ge=0.0, lt=1.0)]
EnergyMode = Literal["power", "cumulative"]
_SAME_TIME_S = 1e-9


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


@dataclass(frozen=True, kw_only=True, slots=True)
class Packet(Generic[Content]):
    """What travels.

    Attributes:
        sequence: Number of the packet, from 0.
        sent_s: Time at which it was sent [s].
        energy_j: Energy of its period, or the total ever sent, by the channel's mode [J].
        content: The message.
    """

    sequence: int
    sent_s: float
    energy_j: float
    content: Content


class Channel(Generic[Content]):
    """Queue of the packets under way. Same seed and calls, same arrivals."""

    def __init__(self, config: ChannelConfig, rng: np.random.Generator) -> None:
        self.config = config
        self._rng = rng
        self._queue: list[tuple[float, int, Packet[Content]]] = []
        self._copies = itertools.count()
        self._sequence = itertools.count()
        self._in_burst = False
        self.sent_j = 0.0
        self.lost_j = 0.0
        self.lost_packets = 0

    def send(self, t_s: float, content: Content, energy_j: float = 0.0) -> None:
        """Queue `content` and the energy `energy_j` of this period: no arrival, one, or two."""
        self.sent_j += energy_j
        cumulative = self.config.energy == "cumulative"
        packet = Packet(
            sequence=next(self._sequence),
            sent_s=t_s,
            energy_j=self.sent_j if cumulative else energy_j,
            content=content,
        )
        if self._is_lost():
            self.lost_packets += 1
            self.lost_j += 0.0 if cumulative else energy_j
            return
        self._enqueue(packet)
        if self.config.duplicate and self._rng.random() < self.config.duplicate:
            self._enqueue(packet)

    def receive(self, t_s: float) -> list[Packet[Content]]:
        """Take every packet that has arrived by `t_s`, in order of arrival."""
        arrived = []
        while self._queue and self._queue[0][0] <= t_s + _SAME_TIME_S:
            arrived.append(heapq.heappop(self._queue)[2])
        return arrived

    def in_flight_j(self, received_j: float) -> float:
        """Energy under way, given what the receiver has counted: sent = received + lost + in flight."""
        return self.sent_j - self.lost_j - received_j

    def _enqueue(self, packet: Packet[Content]) -> None:
        jitter = self.config.jitter_s
        extra = jitter / np.sqrt(2.0) * self._rng.standard_gamma(2.0) if jitter else 0.0
        arrival_s = packet.sent_s + self.config.delay_s + extra
        heapq.heappush(self._queue, (arrival_s, next(self._copies), packet))

    def _is_lost(self) -> bool:
        loss, burst = self.config.loss, self.config.burst_packets
        if loss == 0.0:
            return False
        if burst == 1.0:
            return bool(self._rng.random() < loss)
        stay = 1.0 - 1.0 / burst
        enter = loss / (burst * (1.0 - loss))
        self._in_burst = bool(self._rng.random() < (stay if self._in_burst else enter))
        return self._in_burst
