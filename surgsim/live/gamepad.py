"""A gamepad by the joystick interface of Linux: /dev/input/js* gives time, value, type and number."""

import contextlib
import os
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Self

import numpy as np

from surgsim.errors import SurgsimError
from surgsim.live.controls import Action, Wish

_EVENT = struct.Struct("<IhBB")
_BUTTON, _AXIS, _INITIAL = 1, 2, 0x80
_FULL = 32767.0
DEAD_ZONE = 0.15
ROLL_AXIS, CLUTCH_AXIS = 3, 2
"""Right stick across, and the left trigger: a pedal that counts as pressed from half its way on."""
AXES: Mapping[int, tuple[int, float]] = {0: (0, 1.0), 1: (1, -1.0), 4: (2, -1.0)}
"""Left stick: right and away; right stick: up. A stick pushed away or up gives negative values."""
BUTTONS: Mapping[int, Action] = {0: "jaw", 4: "slower", 5: "faster"}
HELP = (
    "left stick: left, right, away, near | right stick: up, down, roll left, right | "
    "left trigger, held: clutch open | A: jaws | LB RB: speed | Esc: end"
)


def find_gamepad(folder: Path = Path("/dev/input")) -> Path:
    """The first gamepad.

    Raises:
        SurgsimError: If there is none.
    """
    found = sorted(folder.glob("js*"))
    if not found:
        raise SurgsimError(f"no gamepad: there is no {folder}/js*; --operator keyboard needs none")
    return found[0]


class Gamepad:
    """Sticks move the tip, faster the further they are pushed; unplugged, all is at rest."""

    def __init__(self, path: Path) -> None:
        """Open the device.

        Raises:
            SurgsimError: If it may not be read.
        """
        try:
            self._file: int | None = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            raise SurgsimError(f"the gamepad {path} cannot be read: {error.strerror}") from error
        self._direction = np.zeros(3)
        self._roll, self._clutch = 0.0, False
        self._rest = b""

    def poll(self, t_s: float) -> Wish:
        """Where the sticks are, and what was pressed since the last call."""
        data = self._rest + self._read()
        whole = len(data) - len(data) % _EVENT.size
        self._rest = data[whole:]
        actions: list[Action] = []
        for _, value, kind, number in _EVENT.iter_unpack(data[:whole]):
            if kind & ~_INITIAL == _AXIS:
                self._moved(number, value)
            elif kind == _BUTTON and value and number in BUTTONS:
                actions.append(BUTTONS[number])
        return Wish(
            direction=self._direction.copy(),
            roll=self._roll,
            clutch=self._clutch,
            actions=tuple(actions),
        )

    def _moved(self, number: int, value: int) -> None:
        """A stick or a trigger moved."""
        if number in AXES:
            axis, sign = AXES[number]
            self._direction[axis] = sign * _deflection(value)
        elif number == ROLL_AXIS:
            self._roll = _deflection(value)
        elif number == CLUTCH_AXIS:
            self._clutch = value > 0

    def _read(self) -> bytes:
        data = b""
        while self._file is not None:
            try:
                part = os.read(self._file, 64 * _EVENT.size)
            except BlockingIOError:
                break
            except OSError:
                self.close()
                break
            if not part:
                break
            data += part
        return data

    def close(self) -> None:
        """Let go of the device."""
        if self._file is not None:
            with contextlib.suppress(OSError):
                os.close(self._file)
        self._file = None
        self._direction[:] = 0.0
        self._roll, self._clutch = 0.0, False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _deflection(value: int) -> float:
    """From -1 to 1, 0 inside the dead zone and without a jump at its edge."""
    part = max(-1.0, min(1.0, value / _FULL))
    beyond = max(abs(part) - DEAD_ZONE, 0.0) / (1.0 - DEAD_ZONE)
    return beyond if part > 0.0 else -beyond
