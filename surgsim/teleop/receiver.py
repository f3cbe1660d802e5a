"""The receiving end of a channel: newest set point, energy counted once, fading when nothing arrives."""

import math
from collections.abc import Iterable
from typing import Generic, TypeVar

from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.teleop.channel import EnergyMode, Packet

Content = TypeVar("Content")


class ReceiverConfig(PartConfig):
    """How long a set point is believed: held for `hold_s`, then faded to zero over `fade_s`."""

    hold_s: NonNegativeFloat = 0.05
    fade_s: PositiveFloat = 0.2


def fade(age_s: float, config: ReceiverConfig) -> float:
    """Trust in a set point that arrived `age_s` ago, with continuous slope.

    1 up to hold_s, then (1 + cos(pi (age - hold_s) / fade_s)) / 2, and 0 from hold_s + fade_s on.
    """
    late = (age_s - config.hold_s) / config.fade_s
    return 0.5 * (1.0 + math.cos(math.pi * min(max(late, 0.0), 1.0)))


class Receiver(Generic[Content]):
    """Sorts what arrives.

    The packet with the highest sequence number is the set point; an older one that comes late is not.
    The energy of every packet counts once, also of a late one; a duplicate counts for nothing. What was
    lost is remembered as missing, so memory grows with the number of losses alone.
    """

    def __init__(self, config: ReceiverConfig, energy: EnergyMode = "power") -> None:
        self.config = config
        self._cumulative = energy == "cumulative"
        self._missing: set[int] = set()
        self._highest = -1
        self._newest_s = -math.inf
        self.newest: Packet[Content] | None = None
        self.received_j = 0.0
        self.late_packets = 0
        self.duplicate_packets = 0

    def accept(self, t_s: float, packets: Iterable[Packet[Content]]) -> float:
        """Take the packets that arrived at `t_s`; returns the energy that came with them [J]."""
        before = self.received_j
        for packet in packets:
            self._accept(t_s, packet)
        return self.received_j - before

    def trust(self, t_s: float) -> float:
        """Factor for the newest set point at `t_s`; 0 if there is none."""
        return 0.0 if self.newest is None else fade(t_s - self._newest_s, self.config)

    def _accept(self, t_s: float, packet: Packet[Content]) -> None:
        number = packet.sequence
        if number <= self._highest and number not in self._missing:
            self.duplicate_packets += 1
            return
        if self._cumulative:
            self.received_j = max(self.received_j, packet.energy_j)
        else:
            self.received_j += packet.energy_j
        if number > self._highest:
            self._missing.update(range(self._highest + 1, number))
            self._highest, self._newest_s, self.newest = number, t_s, packet
        else:
            self._missing.discard(number)
            self.late_packets += 1
