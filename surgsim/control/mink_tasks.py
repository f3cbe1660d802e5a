"""The RCM as a mink task: two rows that keep the shaft on the trocar."""

import mink
import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class RcmTask(mink.Task):  # type: ignore[misc]
    """Error e_N = N (p - C) and Jacobian of `surgsim.control.rcm`, for mink's solver.

    mink solves J dq = -gain * error; a trocar displacement over the step enters through `target`.
    """

    def __init__(self, tip_site: int, nv: int, cost: float = 1.0, gain: float = 1.0) -> None:
        super().__init__(cost=np.full(2, cost), gain=gain)
        self._site = tip_site
        self._jacp = np.zeros((3, nv))
        self._jacr = np.zeros((3, nv))
        self.target = np.zeros(3)

    def compute_error(self, configuration: mink.Configuration) -> Array:
        """e_N (2,) [m]."""
        N, r = self._frame(configuration)
        return N @ r

    def compute_jacobian(self, configuration: mink.Configuration) -> Array:
        """J_rcm (2, nv) [m/rad]."""
        N, r = self._frame(configuration)
        data = configuration.data
        d = data.site_xmat[self._site].reshape(3, 3)[:, 2]
        mujoco.mj_jacSite(configuration.model, data, self._jacp, self._jacr, self._site)
        turned = np.array([-N[1], N[0]])
        return np.asarray(N @ self._jacp + (d @ r) * (turned @ self._jacr))

    def _frame(self, configuration: mink.Configuration) -> tuple[Array, Array]:
        data = configuration.data
        N = data.site_xmat[self._site].reshape(3, 3)[:, :2].T.copy()
        return N, data.site_xpos[self._site] - self.target
