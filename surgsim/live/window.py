"""MuJoCo's passive viewer as the operator's screen."""

import sys
import threading
import time
import warnings
from typing import Any, Self

import mujoco

from surgsim.array import Array
from surgsim.errors import SurgsimError
from surgsim.live.keyboard import Keyboard
from surgsim.live.picture import Picture, screen_axes
from surgsim.live.status import Status
from surgsim.packages import require
from surgsim.plant.truth import Truth
from surgsim.recording.view import display
from surgsim.simulate.setup import Setup

_REFRESH_S = 1.0 / 60.0
_CLOSING_S = 10.0


def check_display() -> None:
    """Open a hidden window and close it: the viewer itself would wait for ever where that fails.

    Raises:
        SurgsimError: If no window can be opened here.
    """
    if not display():
        raise SurgsimError("operating needs a display, and this session has none")
    if sys.platform == "darwin":
        raise SurgsimError(
            "operating needs MuJoCo's passive viewer, which a plain Python on macOS cannot open"
        )
    require("operating needs", "glfw", "OpenGL")
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        window = None
        if glfw.init():
            glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
            window = glfw.create_window(64, 64, "surgsim", None, None)
            glfw.terminate()
    if not window:
        raise SurgsimError(f"operating needs a window with OpenGL, which display '{display()}' does not give")


class Window:
    """Shows the newest truth; drawing goes on in threads of its own and never holds up the simulation.

    The viewer reports no key that is let go, so at the first key its window's keys are taken over. From then
    on the viewer's own keys do nothing; its mouse does what it always does.
    """

    def __init__(self, setup: Setup, keyboard: Keyboard) -> None:
        self._picture = Picture(setup)
        self._keyboard = keyboard
        self._newest: tuple[Truth, Status] | None = None
        self._leaving = threading.Event()

    def __enter__(self) -> Self:
        import mujoco.viewer

        others = set(threading.enumerate())
        self._viewer = mujoco.viewer.launch_passive(
            self._picture.model,
            self._picture.data,
            key_callback=self._first_key,
            show_left_ui=False,
            show_right_ui=False,
        )
        self._picture.aim(self._viewer.cam)
        self._threads = [thread for thread in threading.enumerate() if thread not in others]
        drawing = threading.Thread(target=self._draw, daemon=True)
        drawing.start()
        self._threads.insert(0, drawing)
        return self

    def __exit__(self, *_: object) -> None:
        """Close, and wait until the viewer's threads have gone: GLFW ends badly under them."""
        self._leaving.set()
        self._viewer.close()
        for thread in self._threads:
            thread.join(_CLOSING_S)

    @property
    def is_open(self) -> bool:
        """Whether the window is still there."""
        return bool(self._viewer.is_running())

    def axes(self) -> Array:
        """The screen's right, away and up in the world, as columns (3, 3)."""
        return screen_axes(self._viewer.cam)

    def show(self, truth: Truth, status: Status) -> None:
        """Draw this as soon as the last picture is done."""
        self._newest = (truth, status)

    def _draw(self) -> None:
        while not self._leaving.is_set() and self._viewer.is_running():
            newest, self._newest = self._newest, None
            if newest is not None:
                truth, status = newest
                self._picture.place(truth)
                self._viewer.sync(state_only=True)
                self._viewer.set_texts(_texts(status))
            time.sleep(_REFRESH_S)

    def _first_key(self, key: int) -> None:
        """Called by the viewer, in the thread to which its window belongs."""
        import glfw

        self._keyboard.changed(key, True)
        glfw.set_key_callback(glfw.get_current_context(), self._key)

    def _key(self, _window: Any, key: int, _code: int, action: int, _modifiers: int) -> None:
        if action in (0, 1):  # let go, pressed; 2 is a repetition
            self._keyboard.changed(key, action == 1)


def _texts(status: Status) -> list[tuple[int | None, int, str, str]]:
    grid = mujoco.mjtGridPos
    names, values = ("\n".join(column) for column in zip(*status.lines, strict=True))
    return [
        (None, grid.mjGRID_TOPLEFT, names, values),
        (None, grid.mjGRID_BOTTOMLEFT, "\n".join(status.help.split(" | ")), ""),
    ]
