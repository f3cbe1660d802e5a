"""Energy tank: the account from which a side pays for what its controller gives away."""

import math
from dataclasses import dataclass
from typing import Self

from pydantic import NonNegativeFloat, PositiveFloat, model_validator

from surgsim.catalog import PartConfig


class TankConfig(PartConfig):
    """Bounds of one tank, T(x_t) = x_t^2 / 2.

    Assumptions, the paper publishes none: 0.2 J pay for 20 N against a 1 kN/m tissue and are little for a
    person. `floor_j` is the paper's epsilon. What exceeds `target_j` is sent to the other side with the
    time constant `send_time_s`, at most `send_limit_w`. What exceeds `capacity_j` is given up as heat.
    """

    initial_j: PositiveFloat = 0.2
    floor_j: PositiveFloat = 0.01
    target_j: PositiveFloat = 0.2
    capacity_j: PositiveFloat = 1.0
    send_time_s: PositiveFloat = 0.1
    send_limit_w: NonNegativeFloat = 2.0

    @model_validator(mode="after")
    def _levels_are_ordered(self) -> Self:
        if not self.floor_j < min(self.initial_j, self.target_j):
            raise ValueError(f"floor_j {self.floor_j:g} must be below initial_j and target_j")
        if max(self.initial_j, self.target_j) > self.capacity_j:
            raise ValueError(f"capacity_j {self.capacity_j:g} must not be below initial_j or target_j")
        return self


@dataclass(frozen=True, kw_only=True, slots=True)
class TankState:
    """State of a tank.

    Attributes:
        x: State x_t [J^0.5], never negative.
        sent_j: Ever sent to the other side.
        overflow_j: Ever given up above the capacity.
        deficit_j: Ever taken though the tank was empty; 0 as long as the budget was respected.
    """

    x: float
    sent_j: float = 0.0
    overflow_j: float = 0.0
    deficit_j: float = 0.0

    @property
    def level_j(self) -> float:
        """T = x^2 / 2."""
        return 0.5 * self.x * self.x


def start(config: TankConfig) -> TankState:
    """The tank at its initial level."""
    return TankState(x=math.sqrt(2.0 * config.initial_j))


def budget(state: TankState, config: TankConfig) -> float:
    """What may be taken in this period: max(T - epsilon, 0) [J]."""
    return max(state.level_j - config.floor_j, 0.0)


def exchange(state: TankState, config: TankConfig, work_j: float, received_j: float) -> TankState:
    """The tank after one period.

    T+ = T - W + E_in, cut at the capacity (overflow) and at zero (deficit).

    Args:
        state: Before.
        config: Bounds.
        work_j: Energy W that the controlled port gave away; negative if it absorbed some, which refills.
        received_j: Energy that came through the channel, not negative.
    """
    level = state.level_j - work_j + received_j
    over, under = max(level - config.capacity_j, 0.0), max(-level, 0.0)
    return TankState(
        x=math.sqrt(2.0 * min(max(level, 0.0), config.capacity_j)),
        sent_j=state.sent_j,
        overflow_j=state.overflow_j + over,
        deficit_j=state.deficit_j + under,
    )


def send_surplus(state: TankState, config: TankConfig, period_s: float) -> tuple[TankState, float]:
    """Take the energy P_out T_s for the other side out of the tank.

    P_out = min(max(T - target, 0) / send_time, send_limit), and never more than the surplus.
    """
    surplus = max(state.level_j - config.target_j, 0.0)
    energy = min(surplus, period_s * min(surplus / config.send_time_s, config.send_limit_w))
    if energy == 0.0:
        return state, 0.0
    taken = TankState(
        x=math.sqrt(2.0 * (state.level_j - energy)),
        sent_j=state.sent_j + energy,
        overflow_j=state.overflow_j,
        deficit_j=state.deficit_j,
    )
    return taken, energy


def affordable(work_j: float, own_work_j: float, budget_j: float) -> float:
    """Largest factor k in [0, 1] for a force so that k W + k^2 W_own <= budget; 0 if there is none.

    Args:
        work_j: W = T_s F.v, at the velocity before the period.
        own_work_j: W_own = T_s^2 |F|^2 / (2 m): what the force adds by accelerating the lightest mass m
            that it may meet. Without it, a force that turns the motion round within a period is free.
        budget_j: T - epsilon; below zero only a force that absorbs enough is left.
    """
    if work_j + own_work_j <= budget_j:
        return 1.0
    square = work_j * work_j + 4.0 * own_work_j * budget_j
    if work_j > 0.0:
        return min(2.0 * budget_j / (work_j + math.sqrt(square)), 1.0) if budget_j > 0.0 else 0.0
    if square < 0.0 or own_work_j == 0.0:
        return 0.0
    root = (math.sqrt(square) - work_j) / (2.0 * own_work_j)
    return root if root <= 1.0 else 0.0  # above 1: even the whole force absorbs too little
