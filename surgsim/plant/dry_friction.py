"""Dry friction of joints that are coupled by their inertia, within a step."""

import numpy as np
from numpy.typing import NDArray

from surgsim.compiled import compiled

Array = NDArray[np.float64]
_SWEEPS = 20
_CLOSE = 1e-9


@compiled
def rub(inverse: Array, most: Array, friction: Array, v: Array) -> None:
    """Take dry friction off the velocities at the end of a step.

    Friction holds a joint that it can hold, and else opposes its motion with all that it has:

        v = v_free - A f,   |f_i| <= F_i,   f_i < F_i  =>  v_i <= 0,   f_i > -F_i  =>  v_i >= 0

    by projected Gauss-Seidel from the friction of the last step, until no joint's friction changes by more
    than a billionth of what it has. It takes energy out or none.

    Args:
        inverse: A, what a torque over the step does to the velocities (n, n) [rad/(s N m)].
        most: F, dry friction of each joint (n,) [N m].
        friction: f of the last step; filled with that of this one (n,) [N m].
        v: v_free; filled with v (n,) [rad/s].

    Source: Moreau's time-stepping with a box-constrained complementarity problem for each step, e.g. Acary
    and Brogliato, Numerical Methods for Nonsmooth Dynamical Systems (2008), chapter 10.
    """
    n = v.size
    for i in range(n):
        for j in range(n):
            v[j] -= inverse[j, i] * friction[i]
    for _ in range(_SWEEPS):
        rest = True
        for i in range(n):
            if most[i] == 0.0:
                continue
            wanted = friction[i] + v[i] / inverse[i, i]
            change = min(max(wanted, -most[i]), most[i]) - friction[i]
            if abs(change) > _CLOSE * most[i]:
                rest = False
            friction[i] += change
            for j in range(n):
                v[j] -= inverse[j, i] * change
        if rest:
            return
