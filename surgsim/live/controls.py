"""From what keys and sticks say to what the operator wants."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from surgsim.array import Array
from surgsim.teleop.manual.intent import Intent

Action = Literal["jaw", "faster", "slower", "end"]
SPEEDS_M_PER_S = (0.002, 0.005, 0.01, 0.02, 0.04)
_FIRST = 3


@dataclass(frozen=True, kw_only=True)
class Wish:
    """What a device says at a moment.

    Attributes:
        direction: Right, away and up on the screen, each from -1 to 1 (3,).
        roll: Turn of the grip to the right, from -1 to 1.
        clutch: Whether the clutch's pedal is pressed.
        actions: What was pressed since it was asked last.
    """

    direction: Array
    roll: float = 0.0
    clutch: bool = False
    actions: tuple[Action, ...] = ()


class Device(Protocol):
    """A keyboard, a gamepad."""

    def poll(self, t_s: float) -> Wish:
        """What it says at the simulated time `t_s` [s]."""
        ...


class Controls:
    """Several devices as one source of input; it holds between two calls of `poll`."""

    def __init__(self, devices: Sequence[Device]) -> None:
        self._devices = devices
        self._speed = _FIRST
        self._intent = Intent()
        self._ended = False

    @property
    def speed_m_per_s(self) -> float:
        """Speed of the tip at full deflection [m/s]."""
        return SPEEDS_M_PER_S[self._speed]

    @property
    def intent(self) -> Intent:
        """What the operator wants now; once done, no motion, a closed clutch and the jaws as they are."""
        return Intent(jaw=self._intent.jaw, end=True) if self._ended else self._intent

    def __call__(self, t_s: float) -> Intent:
        """The input at `t_s` [s], a source for the hand."""
        return self.intent

    def poll(self, t_s: float, axes: Array) -> None:
        """Ask the devices; `axes` (3, 3) has the screen's right, away and up in the world as columns."""
        wishes = [device.poll(t_s) for device in self._devices]
        jaw = self._intent.jaw
        for action in (action for wish in wishes for action in wish.actions):
            if action == "end":
                self.end()
            elif action == "jaw":
                jaw = 1.0 - jaw
            else:
                step = 1 if action == "faster" else -1
                self._speed = min(max(self._speed + step, 0), len(SPEEDS_M_PER_S) - 1)
        direction = np.clip(sum((wish.direction for wish in wishes), np.zeros(3)), -1.0, 1.0)
        x, y, z = (self.speed_m_per_s * (axes @ direction)).tolist()
        roll = min(max(sum(wish.roll for wish in wishes), -1.0), 1.0)
        clutch = any(wish.clutch for wish in wishes)
        self._intent = Intent(velocity=(x, y, z), jaw=jaw, roll=roll, clutch=clutch)

    def end(self) -> None:
        """The operator is done. May be called by a signal's handler, at any moment."""
        self._ended = True
