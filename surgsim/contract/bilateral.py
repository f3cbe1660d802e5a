"""What every bilateral scheme promises."""

from typing import Any

import numpy as np

from surgsim.array import Array
from surgsim.contract.check import Check, require
from surgsim.contract.problems import DT
from surgsim.teleop.bilateral.base import BilateralScheme, End, compiled_only
from surgsim.tick.arrays import new
from surgsim.tick.status import GOES_ON

_TICKS, _LATE = 400, 20
_ROUND_TRIP_S = 2 * _LATE * DT


def _scheme(config: Any) -> BilateralScheme | None:
    """The scheme with its defaults; None of one that the task has built in."""
    scheme: BilateralScheme | None = config().build(DT, _ROUND_TRIP_S)
    return scheme


def _rows(scheme: BilateralScheme, motion: float) -> Array:
    """Answers of both ends (ticks, 9) while the handle is led to and fro by `motion` [m]; the tip obeys."""
    near, far = new(End, 0), new(End, 0)
    memories = [np.zeros(scheme.memory_size) for _ in range(2)]
    forth: list[tuple[Array, float]] = []
    back: list[tuple[Array, float]] = []
    rows = []
    for end in (near, far):
        end.period_s, end.trust = DT, 1.0
    near.mobility_per_kg = 1.0
    for k in range(_TICKS):
        for end, line in ((near, back), (far, forth)):
            end.t_s, end.received_j, end.fresh = DT * k, 0.0, int(k >= _LATE)
            if k >= _LATE:
                end.known, (end.received[:], end.received_j) = 1, line[k - _LATE]
        near.velocity[0] = motion * 10.0 * np.cos(10.0 * DT * k)
        statuses = [scheme.feel(scheme.gains, near, memories[0])]
        near.position[0] += DT * near.velocity[0]
        near.work_j = near.command[0] * DT * near.velocity[0]
        statuses.append(scheme.tell(scheme.gains, near, memories[0]))
        forth.append((near.content.copy(), near.energy_j))
        statuses.append(scheme.follow(scheme.gains, far, memories[1]))
        back.append((far.content.copy(), far.energy_j))
        far.velocity[:] = far.command
        far.position += DT * far.command
        require(statuses == [GOES_ON] * 3, f"at tick {k} the kernels answer {statuses}, not {GOES_ON}")
        rows.append((*near.command, *far.command, near.energy_j, far.energy_j, near.stored_j))
    return np.array(rows)


def answers(config: Any) -> None:
    """Kernels are compiled; answers are finite and the same again; no energy below none is sent."""
    scheme = _scheme(config)
    if scheme is None:
        return
    for name in ("feel", "tell", "follow"):
        compiled_only(getattr(scheme, name), name)
    gains = scheme.gains.copy()
    first = _rows(scheme, 0.01)
    require(np.isfinite(first).all(), "an answer is not finite")
    require((first[:, 6:8] >= 0.0).all(), "an end sends energy below zero")
    require(np.ptp(first[:, 3]) > 1e-4, "a handle that moves does not move the tip")
    require(np.array_equal(_rows(scheme, 0.01), first), "the same again gives other answers")
    require(np.array_equal(scheme.gains, gains), "a kernel changes the gains")


def rests(config: Any) -> None:
    """A handle that rests is given no force, and the tip no velocity."""
    scheme = _scheme(config)
    if scheme is not None:
        still = np.abs(_rows(scheme, 0.0)[:, :6]).max()
        require(still <= 1e-12, f"at rest a force or velocity is {still:.3g}, not 0")


CHECKS = (
    Check(name="kernels are compiled, answer finitely and repeat themselves", run=answers),
    Check(name="leaves handle and tip at rest", run=rests),
)
