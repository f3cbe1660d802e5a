"""A whole teleoperator without an arm: the remote is a point mass with a velocity servo and a wall."""

from dataclasses import dataclass

import numpy as np
import pytest

from surgsim.tasks.base import Feedback
from surgsim.tasks.teleoperation import TeleoperationConfig
from surgsim.tasks.teleoperation_program import GoalConfig
from surgsim.teleop.bilateral.passive_convex import PassiveConvexConfig
from surgsim.teleop.teleoperator import COLUMNS, Law
from surgsim.tick.overlay import laid_over

PERIOD_S = 0.001
NAMES = (*(name for block in COLUMNS for name in block.columns), "x_m", "y_m", "z_m", "force_n", "done")


@dataclass(kw_only=True)
class PointMass:
    """1 kg with a velocity servo, and a wall of 20 kN/m that fills x > wall_m."""

    wall_m: float = np.inf
    mass_kg: float = 1.0
    servo_ns_per_m: float = 400.0
    servo_limit_n: float = 60.0
    wall_n_per_m: float = 20e3
    substeps: int = 4

    def __post_init__(self):
        self.p, self.v = np.zeros(3), np.zeros(3)
        self.force = np.zeros(3)

    def step(self, v_d, budget_j):
        power = PERIOD_S * float(self.force @ v_d)
        if power > budget_j:  # the passivity row, met by the smallest change of v_d
            v_d = v_d - self.force * (power - budget_j) / (PERIOD_S * float(self.force @ self.force))
        h = PERIOD_S / self.substeps
        for _ in range(self.substeps):
            drive = self.servo_ns_per_m * (v_d - self.v)
            drive *= min(1.0, self.servo_limit_n / max(np.linalg.norm(drive), 1e-9))
            before = self.v
            self.v = before + h / self.mass_kg * (drive - self.force)
            self.p = self.p + h * self.v
            self.force = np.array([self.wall_n_per_m * max(self.p[0] - self.wall_m, 0.0), 0.0, 0.0])


def _run(goals, *, mass=None, seed=0, duration_s=20.0, change=None, **keys):
    """Signals of a run as columns; stops half a second after the operator is done.

    `keys` are those of the task's config or of passive_convex; `change` may change its numbers, a `Law`,
    before the start.
    """
    mass = mass or PointMass()
    law = {key: keys.pop(key) for key in set(keys) & set(PassiveConvexConfig.model_fields)}
    keys.setdefault("bilateral", PassiveConvexConfig(**law))
    task = TeleoperationConfig(goals=goals, **keys).build(mass.p, PERIOD_S, np.random.SeedSequence(seed))
    if change is not None:
        change(laid_over(Law, task.gains))
        task.reset()
    rows, done_s = [], np.inf
    for k in range(round(duration_s / PERIOD_S)):
        t = k * PERIOD_S
        zero = np.zeros(3)
        order = task.command(t, Feedback(p_WT=mass.p, v_WT=zero, R_WT=np.eye(3), w_WT=zero, f_T=-mass.force))
        done = task.values()[NAMES.index("operator_done")]
        rows.append((*task.values(), *mass.p, np.linalg.norm(mass.force), done))
        mass.step(order.v_WTd, np.inf if order.budget is None else order.budget.most_j)
        done_s = min(done_s, t) if done else done_s
        if t > done_s + 0.5:
            break
    return dict(zip(NAMES, np.array(rows).T, strict=True))


@pytest.fixture(scope="session")
def teleoperate():
    return _run


@pytest.fixture(scope="session")
def point_mass():
    return PointMass


@pytest.fixture
def goal():
    def make(*position, **changes):
        return GoalConfig(position_m=tuple(float(x) for x in position), **changes)

    return make
