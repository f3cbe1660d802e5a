"""Work of the tip on its surroundings, from sampled force and position."""

from typing import ClassVar

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.tick.arrays import Record


class TipWork(Record):
    """What the last tick left.

    Attributes:
        p: Tip position (3,) [m].
        step: How far the tip came to get there (3,) [m].
        f: Force on the tip over that step (3,) [N].
    """

    SHAPES: ClassVar[dict[str, str]] = {"p": "3", "step": "3", "f": "3"}
    p: Array
    step: Array
    f: Array


@compiled
def add_tip_work(last: TipWork, p: Array, f_T: Array, share: float) -> float:
    """Energy given away since the last call [J], by the trapezoidal rule.

    The force f_k known at tick k acted over the last physics step before it, so it belongs to the instant at
    which that step began, a share a of the control period ago, when the tip was at about

        P_k = p_k - a (p_k - p_{k-1}).

    The work over (P_{k-1}, P_k) is W = -(f_{k-1} + f_k)/2 . (P_k - P_{k-1}), and from P_k on only
    -f_k . (p_k - P_k) is known, which the next tick corrects. Pairing f_k with p_k instead would book a
    spring of stiffness k as a damper of k a T_s. Exact for a linear spring if the control period is one
    physics step, a = 1; else of second order in the period.

    Args:
        last: At first the tip's position at the start, and zeros.
        p: Tip position now (3,) [m].
        f_T: Force on the tip over the physics step that ended now (3,) [N].
        share: a, the physics step over the control period.
    """
    work = 0.0
    for i in range(3):
        step = p[i] - last.p[i]
        known = (1.0 - share) * step + share * last.step[i]
        work -= 0.5 * (last.f[i] + f_T[i]) * known + share * (f_T[i] * step - last.f[i] * last.step[i])
        last.step[i], last.p[i], last.f[i] = step, p[i], f_T[i]
    return work
