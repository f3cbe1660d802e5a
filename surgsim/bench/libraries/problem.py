"""The problem that every library solves: a circle of the tip, the shaft through the trocar."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from surgsim.array import Array
from surgsim.bench.cases import kinematic
from surgsim.control.rcm import rcm_kinematics
from surgsim.models.arm import ArmModel
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

MOST_APART_M = 1e-9
"""How far a library's forward kinematics may be from the model's."""


@dataclass(frozen=True, kw_only=True)
class Circle:
    """Where the tip is to be after each tick.

    Attributes:
        arm: The nominal arm.
        dt_s: Control period [s].
        q_start: Joint positions at the first tick (n,) [rad].
        targets: Tip positions at every tick (k, 3) [m]; the first is where it is.
        p_WC: The trocar (3,) [m].
    """

    arm: ArmModel
    dt_s: float
    q_start: Array
    targets: Array
    p_WC: Array


@dataclass(frozen=True, kw_only=True)
class Errors:
    """How well joint positions solve it.

    Attributes:
        tip_rms_um: Distance of the tip from its target, root mean square [um].
        rcm_rms_um: Distance of the trocar from the shaft, root mean square [um].
    """

    tip_rms_um: float
    rcm_rms_um: float


class Library(Protocol):
    """A library set up for the problem.

    Attributes:
        name: What tables call it.
        version: Its release.
        how: Solver and settings, in a few words.
    """

    name: str
    version: str
    how: str

    def tip(self, q: Array) -> Array:
        """Its forward kinematics: tip (3,) [m] at `q` (n,) [rad]."""

    def start(self, q: Array) -> None:
        """Be at `q` (n,) [rad]."""

    def step(self, target: Array) -> Array:
        """Joint positions (n,) [rad] a tick later, the tip led to `target` (3,) [m]."""


Factory = Callable[[Circle], Library]


def circle_problem(duration_s: float) -> Circle:
    """The shipped circle for `duration_s` [s], as long as it lasts at most."""
    scenario = kinematic("pinv").scenario()
    setup = prepare(scenario)
    simulation = Simulation(setup)
    simulation.advance(round(duration_s / scenario.simulation.control_period_s))
    assert scenario.trocar is not None
    return Circle(
        arm=setup.arm,
        dt_s=scenario.simulation.control_period_s,
        q_start=setup.q_start.copy(),
        targets=simulation.trace().block("tip_ref"),
        p_WC=np.array(scenario.trocar.position_m),
    )


def errors_of(circle: Circle, q: Array) -> Errors:
    """Errors of joint positions `q` (k, n) [rad] at the ticks from the second on, by the model."""
    tip, rcm = [], []
    for target, joints in zip(circle.targets[1:], q, strict=False):
        at = circle.arm.kinematics(joints)
        tip.append(np.sum((at.p_WT - target) ** 2))
        rcm.append(np.sum(rcm_kinematics(at, circle.p_WC, np.zeros(3)).error ** 2))
    return Errors(
        tip_rms_um=1e6 * float(np.sqrt(np.mean(tip))), rcm_rms_um=1e6 * float(np.sqrt(np.mean(rcm)))
    )


def apart(circle: Circle, library: Library, count: int = 20) -> float:
    """Largest distance [m] of a library's tip from the model's, over `count` postures inside the limits."""
    limits, random = circle.arm.limits, np.random.default_rng(0)
    postures = random.uniform(limits.q_min, limits.q_max, (count, limits.q_min.size))
    return max(float(np.linalg.norm(library.tip(q) - circle.arm.kinematics(q).p_WT)) for q in postures)
