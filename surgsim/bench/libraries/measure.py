"""Times and errors of the libraries and of our own kinematic ticks, measured in turn."""

from collections.abc import Callable
from dataclasses import asdict
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import mujoco
import numpy as np

from surgsim import __version__
from surgsim.array import Array
from surgsim.bench.cases import KINEMATIC, kinematic
from surgsim.bench.chunks import CHUNK, in_turn
from surgsim.bench.libraries.problem import MOST_APART_M, Circle, Library, apart, circle_problem, errors_of
from surgsim.errors import told
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

LIBRARIES = {
    "mink": ("mink", "with_mink", "Mink", "mink"),
    "placo": ("placo", "with_placo", "Placo", "placo"),
    "pink": ("pink", "with_pink", "Pink", "pin-pink"),
    "dqrobotics": ("dqrobotics", "with_dqrobotics", "DqRobotics", "dqrobotics"),
}
"""Module that must be there, ours for it, its class, and the package to install."""

Row = dict[str, Any]


class _Theirs:
    """A library on the problem, a chunk a call."""

    def __init__(self, library: Library, circle: Circle) -> None:
        self.name, self.version, self.how = library.name, library.version, library.how
        self._library, self._targets = library, circle.targets
        self._q = np.empty((len(circle.targets) - 1, circle.q_start.size))
        self._done = 0
        library.start(circle.q_start)

    def __call__(self) -> None:
        step, targets, q = self._library.step, self._targets, self._q
        for k in range(self._done, self._done + CHUNK):
            q[k] = step(targets[k + 1])
        self._done += CHUNK

    @property
    def q(self) -> Array:
        """Joint positions so far, from the second tick on."""
        return self._q[: self._done]


class _Ours:
    """A resolver in our whole kinematic tick: task, port, limits and trace as well, a chunk a call."""

    def __init__(self, controller: str) -> None:
        self.name, self.version = f"surgsim {controller}", __version__
        self.how = "a whole tick: task, limits and trace too"
        self._simulation = Simulation(prepare(kinematic(controller).scenario()))

    def __call__(self) -> None:
        self._simulation.advance(CHUNK)

    @property
    def q(self) -> Array:
        """Joint positions so far, from the second tick on."""
        return self._simulation.trace().block("q")[1:]


def measure_libraries(duration_s: float) -> list[Row]:
    """A row for each of our kinematic ticks and each library; one that is not installed says so in `how`.

    Args:
        duration_s: Simulated time [s]; on the circle as long as it lasts at most.
    """
    circle = circle_problem(duration_s)
    rounds = (len(circle.targets) - 1) // CHUNK - 1
    ours = [_Ours(name) for name in KINEMATIC]
    theirs: list[_Theirs] = []
    missing: list[Row] = []
    for name, known in LIBRARIES.items():
        found = _loaded(known, circle)
        if isinstance(found, str):
            missing.append(_row(name, how=found))
        else:
            theirs.append(_Theirs(found, circle))
    all_of_them: list[_Ours | _Theirs] = [*ours, *theirs]
    times = in_turn([*all_of_them, _bare_steps(circle)], rounds) / CHUNK
    rows = []
    for k, one in enumerate(all_of_them):
        errors, ratio = errors_of(circle, one.q), float(np.median(times[:, k] / times[:, -1]))
        tick_us = 1e6 * float(np.median(times[:, k]))
        rows.append(_row(one.name, one.version, tick_us, ratio, how=one.how, **asdict(errors)))
    return [*rows, *missing]


def _row(
    library: str,
    version: str | None = None,
    tick_us: float | None = None,
    ratio: float | None = None,
    tip_rms_um: float | None = None,
    rcm_rms_um: float | None = None,
    *,
    how: str,
) -> Row:
    return {
        "library": library,
        "version": version,
        "tick_us": tick_us,
        "ratio": ratio,
        "tip_rms_um": tip_rms_um,
        "rcm_rms_um": rcm_rms_um,
        "how": how,
    }


def _loaded(known: tuple[str, str, str, str], circle: Circle) -> Library | str:
    """The library set up for the problem, or why it is not."""
    module, ours, name, package = known
    if find_spec(module) is None:
        return f"not installed (pip install {package})"
    try:
        library: Library = getattr(import_module(f"surgsim.bench.libraries.{ours}"), name)(circle)
        distance = apart(circle, library)
    except Exception as error:  # a release that is made differently: the others are measured
        return f"cannot be used: {told(error)}"
    if not distance < MOST_APART_M:
        return f"not measured: its forward kinematics are {distance:.1e} m off"
    return library


def _bare_steps(circle: Circle) -> Callable[[], None]:
    """As many `mj_step` of the nominal arm, at rest."""
    model = circle.arm.scene.model
    data = mujoco.MjData(model)

    def step() -> None:
        data.qpos[:], data.qvel[:] = circle.q_start, 0.0
        mujoco.mj_step(model, data, nstep=CHUNK)

    return step
