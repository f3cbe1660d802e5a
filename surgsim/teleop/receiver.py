"""The receiving end of a channel: newest set point, energy counted once, fading when nothing arrives."""

import math
from typing import ClassVar

from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.teleop.channel import ENERGY, MESSAGE, NUMBER, SENT, Channel, ChannelLaw, arrived
from surgsim.teleop.messages import CONTENT
from surgsim.tick.arrays import Record


class ReceiverConfig(PartConfig):
    """How long a set point is believed: held for `hold_s`, then faded to zero over `fade_s`."""

    hold_s: NonNegativeFloat = 0.05
    fade_s: PositiveFloat = 0.2


class ReceiverLaw(Record):
    """Numbers of a receiver.

    Attributes:
        hold_s: As in `ReceiverConfig`.
        fade_s: As in `ReceiverConfig`.
        cumulative: Whether a packet carries the total ever sent.
        taken: Where in the memory the numbers of the packets taken last begin.
        window: How many: a packet that is later by so many others does not exist.
    """

    hold_s: float
    fade_s: float
    cumulative: int
    taken: int
    window: int


class Receiver(Record):
    """State of a receiver.

    Attributes:
        highest: Highest number of a packet so far, -1 before the first.
        newest_s: When it came [s].
        sent_s: When it was sent [s].
        content: Its message, twelve numbers.
        received_j: Energy received [J].
        late_packets: Packets that came after one sent later.
        duplicate_packets: Packets that came again.
    """

    SHAPES: ClassVar[dict[str, str]] = {"content": str(CONTENT)}
    highest: int
    newest_s: float
    sent_s: float
    content: Array
    received_j: float
    late_packets: int
    duplicate_packets: int


def expect(law: ReceiverLaw, receiver: Receiver, memory: Array) -> None:
    """Begin: nothing has come."""
    receiver.highest, receiver.newest_s = -1, -math.inf
    memory[law.taken : law.taken + law.window] = -1.0


@compiled
def fade(age_s: float, hold_s: float, fade_s: float) -> float:
    """Trust in a set point that arrived `age_s` ago, with continuous slope.

    1 up to hold_s, then (1 + cos(pi (age - hold_s) / fade_s)) / 2, and 0 from hold_s + fade_s on.
    """
    late = (age_s - hold_s) / fade_s
    return 0.5 * (1.0 + math.cos(math.pi * min(max(late, 0.0), 1.0)))


@compiled
def trust(law: ReceiverLaw, receiver: Receiver, t_s: float) -> float:
    """Factor for the newest set point at `t_s`; 0 if there is none."""
    return 0.0 if receiver.highest < 0 else fade(t_s - receiver.newest_s, law.hold_s, law.fade_s)


@compiled
def accept(law: ReceiverLaw, receiver: Receiver, memory: Array, at: int, t_s: float) -> None:
    """Take the packet whose row is at `at`.

    The packet with the highest number is the set point; an older one that comes late is not. The energy of
    every packet counts once, also of a late one; a duplicate counts for nothing.
    """
    number = int(memory[at + NUMBER])
    seat = law.taken + number % law.window
    if number <= receiver.highest and memory[seat] == number:
        receiver.duplicate_packets += 1
        return
    memory[seat] = number
    if law.cumulative:
        receiver.received_j = max(receiver.received_j, memory[at + ENERGY])
    else:
        receiver.received_j += memory[at + ENERGY]
    if number <= receiver.highest:
        receiver.late_packets += 1
        return
    receiver.highest, receiver.newest_s, receiver.sent_s = number, t_s, memory[at + SENT]
    for i in range(CONTENT):
        receiver.content[i] = memory[at + MESSAGE + i]


@compiled
def receive(
    law: ReceiverLaw, receiver: Receiver, line: ChannelLaw, channel: Channel, memory: Array, t_s: float
) -> float:
    """Take every packet that has arrived by `t_s`, in order of arrival; the energy that came [J]."""
    before = receiver.received_j
    at = arrived(line, channel, memory, t_s)
    while at >= 0:
        accept(law, receiver, memory, at, t_s)
        at = arrived(line, channel, memory, t_s)
    return receiver.received_j - before
