"""Work of the tip on its surroundings, from sampled force and position."""

from typing import ClassVar

from surgsim.compiled import compiled
from surgsim.tick.arrays import Array, Record


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
def add_tip_work(last: TipWork, p: Array, f_T: Array) -> float:
    """Energy given away since the last call [J], by the trapezoidal rule.

    The force f_k known at tick k acted over the step that ended there, so it belongs to the instant of
    p_{k-1}. The work over (p_{k-2}, p_{k-1}) is therefore

        W = -(f_{k-1} + f_k)/2 . (p_{k-1} - p_{k-2}),

    and of the last step only -f_k . (p_k - p_{k-1}) is known, which the next tick corrects. Pairing f_k with
    p_k instead would book a spring of stiffness k as a damper of k T_s. Exact for a linear spring if the
    control period is one physics step; with n steps f_k is up to (n-1)/n of a period younger than assumed.

    Args:
        last: At first the tip's position at the start, and zeros.
        p: Tip position now (3,) [m].
        f_T: Force on the tip over the step that ended now (3,) [N].
    """
    change = work = 0.0
    for i in range(3):
        change += (f_T[i] - last.f[i]) * last.step[i]
    for i in range(3):
        last.step[i], last.p[i], last.f[i] = p[i] - last.p[i], p[i], f_T[i]
        work += f_T[i] * last.step[i]
    return -0.5 * change - work
