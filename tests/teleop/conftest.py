"""A whole teleoperator without an arm: the remote is a point mass with a velocity servo and a wall."""

from dataclasses import dataclass

import numpy as np
import pytest

from surgsim.teleop.account import ACCOUNT_COLUMNS, account
from surgsim.teleop.channel import Channel, ChannelConfig
from surgsim.teleop.operator import Goal
from surgsim.teleop.operator_side import OPERATOR_COLUMNS, OperatorSide, OperatorSideConfig
from surgsim.teleop.remote_side import REMOTE_COLUMNS, RemoteMeasurement, RemoteSide, RemoteSideConfig

PERIOD_S = 0.001
COLUMNS = (*OPERATOR_COLUMNS, *REMOTE_COLUMNS, *ACCOUNT_COLUMNS)
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
        self.force, self.work_j = np.zeros(3), 0.0

    def step(self, v_d, budget_j):
        power = PERIOD_S * float(self.force @ v_d)
        if power > budget_j:  # the passivity row, met by the smallest change of v_d
            v_d = v_d - self.force * (power - budget_j) / (PERIOD_S * float(self.force @ self.force))
        h, self.work_j = PERIOD_S / self.substeps, 0.0
        for _ in range(self.substeps):
            drive = self.servo_ns_per_m * (v_d - self.v)
            drive *= min(1.0, self.servo_limit_n / max(np.linalg.norm(drive), 1e-9))
            before = self.v
            self.v = before + h / self.mass_kg * (drive - self.force)
            old = self.p
            self.p = old + h * self.v
            new = np.array([self.wall_n_per_m * max(self.p[0] - self.wall_m, 0.0), 0.0, 0.0])
            self.work_j += float(0.5 * (self.force + new) @ (self.p - old))
            self.force = new


def _run(goals, *, operator=None, remote=None, channel=None, mass=None, seed=0, duration_s=20.0, push=None):
    """Signals of a run as columns; stops half a second after the operator is done.

    `push(t)` is added to the hand's wrench's target: extra force of the hand on the handle (3,).
    """
    operator, remote = operator or OperatorSideConfig(), remote or RemoteSideConfig()
    channel, mass = channel or ChannelConfig(), mass or PointMass()
    seeds = np.random.SeedSequence(seed).spawn(3)
    near = OperatorSide(operator, goals, mass.p, channel.energy, seeds[0])
    far = RemoteSide(remote, mass.p, channel.energy, PERIOD_S)
    forth, back = (Channel(channel, np.random.default_rng(s)) for s in seeds[1:])
    rows, done_s = [], np.inf
    for k in range(round(duration_s / PERIOD_S)):
        t = k * PERIOD_S
        sent = near.step(t, back.receive(t))
        forth.send(t, sent.message, sent.energy_j)
        measured = RemoteMeasurement(position=mass.p.copy(), force=mass.force.copy(), work_j=mass.work_j)
        order = far.step(t, forth.receive(t), measured)
        back.send(t, order.message, order.energy_j)
        books = account(near, far, forth, back)
        rows.append(
            (*near.signals(), *far.signals(), *books, *mass.p, np.linalg.norm(mass.force), sent.hand.done)
        )
        mass.step(order.velocity, order.budget_j)
        done_s = min(done_s, t) if sent.hand.done else done_s
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
        return Goal(position=tuple(float(x) for x in position), **changes)

    return make
