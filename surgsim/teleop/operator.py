"""A simulated operator: what the eyes see decides, the hand's impedance acts."""

import enum
import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.teleop.console import ConsoleState
from surgsim.teleop.impedance import hand_wrench
from surgsim.teleop.mapping import Mapping
from surgsim.teleop.reach import Reach, ReachConfig, aim
from surgsim.teleop.tremor import Tremor, TremorConfig

Array = NDArray[np.float64]


class OperatorConfig(PartConfig):
    """Eyes, decisions and hand of the operator.

    Hand impedance 135 N/m and 6.45 N s/m: the fit shown for an arm in Sci. Rep. 5, 18004 (2015); gripping
    harder raises both. The orientation values only keep the grip upright and are assumptions.

    Against delay the operator moves and waits (Ferrell, IEEE Trans. Hum. Factors Electron. 6, 1965): after
    a movement it waits `expected_delay_s`, the round trip it is used to, then for the tip on the screen to
    rest, and only then corrects. Every decision takes `reaction_s`. A goal at the place of the one before is
    for the jaws alone: the hand stays, and waits until it must have seen them act.
    """

    reaction_s: NonNegativeFloat = 0.2
    expected_delay_s: NonNegativeFloat = 0.3
    rest_speed_m_per_s: PositiveFloat = 0.003
    gaze_time_s: PositiveFloat = 0.08
    stiffness_n_per_m: PositiveFloat = 135.0
    damping_ns_per_m: NonNegativeFloat = 6.45
    turn_stiffness_nm_per_rad: NonNegativeFloat = 0.15
    turn_damping_nms_per_rad: NonNegativeFloat = 0.003
    jaw_time_s: PositiveFloat = 0.3
    reach: ReachConfig = ReachConfig()
    tremor: TremorConfig = TremorConfig()


@dataclass(frozen=True, kw_only=True)
class Goal:
    """One step of the operator's program, in remote tip coordinates.

    Attributes:
        position: Where the tip shall be (3,) [m]; may lie beyond a wall.
        tolerance_m: How near is near enough; half the target width of Fitts' law.
        dwell_s: How long the tip is to be seen there, or the push to last.
        jaw: Closing of the jaws during this goal, 0 open to 1 closed.
        push: Go there once, without correcting by sight, and stay for `dwell_s`.
        timeout_s: After this the operator gives up and takes the next goal.
    """

    position: tuple[float, float, float]
    tolerance_m: float = 0.002
    dwell_s: float = 0.2
    jaw: float = 0.0
    push: bool = False
    timeout_s: float = math.inf


@dataclass(frozen=True, kw_only=True, slots=True)
class HandCommand:
    """What the hand does in one period.

    Attributes:
        wrench: Force and torque on the handle in O (6,) [N, N m].
        jaw: Closing of the pinch grip, 0 to 1.
        goal: Index of the goal; the number of goals once done.
        done: No goal is left.
        missed: Goals given up so far.
        intended: Where the hand is meant to be, in O (3,) [m], without tremor; NaN if it does not say.
    """

    wrench: Array
    jaw: float
    goal: int
    done: bool
    missed: int
    intended: Array = field(default_factory=lambda: np.full(3, np.nan))


class Hand(Protocol):
    """Whoever holds the handle: the simulated operator, or a person at a keyboard."""

    def step(self, t_s: float, seen_tip: ArrayLike, handle: ConsoleState) -> HandCommand:
        """What the hand does in the period from `t_s`, given the tip on the screen and the console."""
        ...


class Phase(enum.Enum):
    """What the operator is doing."""

    MOVE = "moving the hand"
    WATCH = "waiting for the picture to rest"
    DWELL = "staying at the goal"
    DONE = "no goal is left"


class Operator:
    """Carries out a program of goals. Same seed and inputs, same forces.

    Force on the handle: F = K (x_int + x_tremor - x_o) + D (v_int + v_tremor - v_o).
    """

    def __init__(
        self,
        config: OperatorConfig,
        goals: tuple[Goal, ...],
        mapping: Mapping,
        period_s: float,
        seed: np.random.SeedSequence,
    ) -> None:
        self.config = config
        self.goals = goals
        self._mapping = mapping
        self._period_s = period_s
        self._seed = seed
        self._blur = 1.0 - math.exp(-period_s / config.gaze_time_s)
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next step begins the first goal."""
        tremor, scatter = (
            np.random.SeedSequence(self._seed.entropy, spawn_key=(*self._seed.spawn_key, i)) for i in (0, 1)
        )
        self._tremor = Tremor(self.config.tremor, self._period_s, np.random.default_rng(tremor))
        self._rng = np.random.default_rng(scatter)
        self._seen: Array | None = None
        self._speed = np.zeros(3)
        self._jaw = 0.0
        self._index, self._missed = 0, 0
        self._target: Array | None = None
        self.phase = Phase.DONE

    def step(self, t_s: float, seen_tip: ArrayLike, handle: ConsoleState) -> HandCommand:
        """Look, decide, act.

        Args:
            t_s: Time.
            seen_tip: Remote tip as the screen shows it, already delayed (3,) [m].
            handle: The console.
        """
        self._look(np.asarray(seen_tip, dtype=float), handle, t_s)
        self._decide(t_s)
        intended, velocity = self._reach.at(t_s)
        self._close_jaw()
        return HandCommand(
            wrench=self._act(intended, velocity, handle),
            jaw=self._jaw,
            goal=self._index,
            done=self.phase is Phase.DONE,
            missed=self._missed,
            intended=intended,
        )

    def _look(self, tip: Array, handle: ConsoleState, t_s: float) -> None:
        if self._seen is None:
            self._seen = tip.copy()
            self._reach = Reach(start_s=t_s - 1.0, duration_s=1.0, origin=handle.position, change=np.zeros(3))
            self._upright = handle.rotation
            if self.goals:
                self._begin(0, t_s)
            return
        change = self._blur * (tip - self._seen)
        self._seen = self._seen + change
        self._speed = self._speed + self._blur * (change / self._period_s - self._speed)

    def _begin(self, index: int, t_s: float) -> None:
        self._index, self._goal_start_s = index, t_s
        if index == len(self.goals):
            self.phase = Phase.DONE
            return
        goal, before = self.goals[index], self._target
        self._target = np.array(goal.position)
        if (
            before is not None
            and np.array_equal(before, self._target)
            and self._distance() <= goal.tolerance_m
        ):
            self.phase, self._leave_s = Phase.DWELL, t_s + self.config.expected_delay_s + goal.dwell_s
            return
        self._move(t_s)

    def _move(self, t_s: float) -> None:
        """Aim the hand so that the tip, seen where it is, would reach the goal; begin after the reaction."""
        assert self._seen is not None
        assert self._target is not None
        origin = self._reach.at(t_s)[0]
        change = self._mapping.motion_to_console(self._target - self._seen)
        width = 2.0 * self.goals[self._index].tolerance_m / self._mapping.scale
        start = t_s + self.config.reaction_s
        self._reach = aim(origin, origin + change, width, start, self.config.reach, self._rng)
        self.phase = Phase.MOVE

    def _decide(self, t_s: float) -> None:
        if self.phase is Phase.DONE:
            return
        goal = self.goals[self._index]
        if t_s - self._goal_start_s > goal.timeout_s:
            self._missed += 1
            self._begin(self._index + 1, t_s)
        elif self.phase is Phase.MOVE:
            self._finish_move(t_s, goal)
        elif self.phase is Phase.WATCH:
            self._watch(t_s, goal)
        elif t_s >= self._leave_s:
            self._begin(self._index + 1, t_s)
        elif not goal.push and self._distance() > goal.tolerance_m:
            self._move(t_s)

    def _finish_move(self, t_s: float, goal: Goal) -> None:
        if t_s < self._reach.end_s:
            return
        self.phase = Phase.DWELL if goal.push else Phase.WATCH
        self._leave_s = t_s + goal.dwell_s

    def _watch(self, t_s: float, goal: Goal) -> None:
        rests = float(self._speed @ self._speed) < self.config.rest_speed_m_per_s**2
        if t_s < self._reach.end_s + self.config.expected_delay_s or not rests:
            return
        if self._distance() <= goal.tolerance_m:
            self.phase, self._leave_s = Phase.DWELL, t_s + goal.dwell_s
        else:
            self._move(t_s)

    def _distance(self) -> float:
        assert self._seen is not None
        assert self._target is not None
        error = self._target - self._seen
        return math.sqrt(float(error @ error))

    def _close_jaw(self) -> None:
        wanted = self.goals[min(self._index, len(self.goals) - 1)].jaw if self.goals else 0.0
        most = self._period_s / self.config.jaw_time_s
        self._jaw += min(max(wanted - self._jaw, -most), most)

    def _act(self, intended: Array, velocity: Array, handle: ConsoleState) -> Array:
        shake, shake_velocity = self._tremor.step()
        return hand_wrench(self.config, intended + shake, velocity + shake_velocity, self._upright, handle)
