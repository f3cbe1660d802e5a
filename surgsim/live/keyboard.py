"""Keys of the window as a device. Key codes are GLFW's."""

from collections.abc import Mapping
from queue import Empty, SimpleQueue

import numpy as np

from surgsim.live.controls import Action, Wish

_RIGHT, _LEFT, _DOWN, _UP, _PAGE_UP, _PAGE_DOWN, _HOME, _END = range(262, 270)
DIRECTIONS: Mapping[int, tuple[int, float]] = {
    _RIGHT: (0, 1.0),
    _LEFT: (0, -1.0),
    _UP: (1, 1.0),
    _DOWN: (1, -1.0),
    _PAGE_UP: (2, 1.0),
    _PAGE_DOWN: (2, -1.0),
}
ROLLS: Mapping[int, float] = {_HOME: -1.0, _END: 1.0}
CLUTCHES = (341, 345)
"""The two Ctrl keys: the pedal of the clutch."""
ACTIONS: Mapping[int, Action] = {
    32: "jaw",  # space
    256: "end",  # escape
    61: "faster",  # =, + on many keyboards
    45: "slower",  # -
    334: "faster",  # + of the number pad
    333: "slower",  # - of the number pad
}
HELP = (
    "arrows: left, right, away, near | Page Up/Down: up, down | Home End: roll left, right | "
    "Ctrl, held: clutch open | Space: jaws | + -: speed | Esc: end"
)
TAP_S = 0.05


class Keyboard:
    """A key acts for as long as it is held, one that moves at least for `TAP_S` of simulated time.

    `changed` may be called from another thread, e.g. the window's.
    """

    def __init__(self) -> None:
        self._changes: SimpleQueue[tuple[int, bool]] = SimpleQueue()
        self._down: set[int] = set()
        self._until: dict[int, float] = {}

    def changed(self, key: int, pressed: bool) -> None:
        """A key went down or up."""
        self._changes.put((key, pressed))

    def poll(self, t_s: float) -> Wish:
        """Keys held at `t_s` [s], and what was pressed since the last call."""
        actions: list[Action] = []
        while True:
            try:
                key, pressed = self._changes.get_nowait()
            except Empty:
                break
            if pressed and key in ACTIONS:
                actions.append(ACTIONS[key])
            elif pressed and (key in DIRECTIONS or key in ROLLS):
                self._down.add(key)
                self._until[key] = t_s + TAP_S
            elif pressed and key in CLUTCHES:
                self._down.add(key)
            else:
                self._down.discard(key)
        direction = np.zeros(3)
        for key, (axis, sign) in DIRECTIONS.items():
            direction[axis] += sign * self._acts(key, t_s)
        return Wish(
            direction=direction,
            roll=sum(sign * self._acts(key, t_s) for key, sign in ROLLS.items()),
            clutch=any(key in self._down for key in CLUTCHES),
            actions=tuple(actions),
        )

    def _acts(self, key: int, t_s: float) -> bool:
        return key in self._down or t_s < self._until.get(key, -1.0)
