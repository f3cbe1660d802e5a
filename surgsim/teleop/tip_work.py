"""Work of the tip on its surroundings, from sampled force and position."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class TipWork:
    """Trapezoidal rule for the work of a sampled contact force.

    The force f_k known at tick k acted over the step that ended there, so it belongs to the instant of
    p_{k-1}. The work over (p_{k-2}, p_{k-1}) is therefore

        W = -(f_{k-1} + f_k)/2 . (p_{k-1} - p_{k-2}),

    and of the last step only -f_k . (p_k - p_{k-1}) is known, which the next tick corrects. Pairing f_k with
    p_k instead would book a spring of stiffness k as a damper of k T_s. Exact for a linear spring if the
    control period is one physics step; with n steps f_k is up to (n-1)/n of a period younger than assumed.

    Args:
        p: Tip position at the start (3,) [m].
    """

    def __init__(self, p: Array) -> None:
        self._p, self._step, self._f = p, np.zeros(3), np.zeros(3)

    def add(self, p: Array, f_T: Array) -> float:
        """Energy given away since the last call [J].

        Args:
            p: Tip position now (3,) [m].
            f_T: Force on the tip over the step that ended now (3,) [N].
        """
        correction = -0.5 * float((f_T - self._f) @ self._step)
        self._p, self._step, self._f = p, p - self._p, f_T
        return correction - float(f_T @ self._step)
