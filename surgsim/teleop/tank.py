"""Energy tank: the account from which a side pays for what its controller gives away."""

import math
from typing import Self

from pydantic import NonNegativeFloat, PositiveFloat, model_validator

from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.tick.arrays import Record


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


class TankLaw(Record):
    """Numbers of a tank, as in `TankConfig`."""

    initial_j: float
    floor_j: float
    target_j: float
    capacity_j: float
    send_time_s: float
    send_limit_w: float


class Tank(Record):
    """State of a tank.

    Attributes:
        x: State x_t [J^0.5], never negative.
        sent_j: Ever sent to the other side.
        overflow_j: Ever given up above the capacity.
        deficit_j: Ever taken though the tank was empty; 0 as long as the budget was respected.
    """

    x: float
    sent_j: float
    overflow_j: float
    deficit_j: float


@compiled
def level(tank: Tank) -> float:
    """T = x^2 / 2 [J]."""
    return 0.5 * tank.x * tank.x


@compiled
def fill_tank(law: TankLaw, tank: Tank) -> None:
    """Bring a new tank to its initial level."""
    tank.x = math.sqrt(2.0 * law.initial_j)


@compiled
def budget(law: TankLaw, tank: Tank) -> float:
    """What may be taken in this period: max(T - epsilon, 0) [J]."""
    return max(level(tank) - law.floor_j, 0.0)


@compiled
def exchange(law: TankLaw, tank: Tank, work_j: float, received_j: float) -> None:
    """One period of the tank.

    T+ = T - W + E_in, cut at the capacity (overflow) and at zero (deficit).

    Args:
        law: Bounds.
        tank: Changed in place.
        work_j: Energy W that the controlled port gave away; negative if it absorbed some, which refills.
        received_j: Energy that came through the channel, not negative.
    """
    after = level(tank) - work_j + received_j
    tank.overflow_j += max(after - law.capacity_j, 0.0)
    tank.deficit_j += max(-after, 0.0)
    tank.x = math.sqrt(2.0 * min(max(after, 0.0), law.capacity_j))


@compiled
def send_surplus(law: TankLaw, tank: Tank, period_s: float) -> float:
    """Take the energy P_out T_s for the other side out of the tank; how much it is [J].

    P_out = min(max(T - target, 0) / send_time, send_limit), and never more than the surplus.
    """
    now = level(tank)
    surplus = max(now - law.target_j, 0.0)
    energy = min(surplus, period_s * min(surplus / law.send_time_s, law.send_limit_w))
    if energy > 0.0:
        tank.x = math.sqrt(2.0 * (now - energy))
        tank.sent_j += energy
    return energy


@compiled
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
