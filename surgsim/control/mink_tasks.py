"""What mink is given by us: the RCM as two rows that keep the shaft on the trocar, and the joints' limits."""

from collections.abc import Mapping

import mink
import mujoco
import numpy as np

from surgsim.array import Array

_VIEWS = ("_data", "_N", "_d", "_p")


class RcmTask(mink.Task):  # type: ignore[misc]
    """Error e_N = N (p - C) and Jacobian of `surgsim.control.rcm`, p the shaft's end, for mink's solver.

    mink solves J dq = -gain * error; a trocar displacement over the step enters through `target`.

    Args:
        end_site: The shaft's end, z along the shaft.
        nv: Joints.
        cost: Weight of each row.
        gain: Share of the error that a step takes.
    """

    _data: mujoco.MjData | None = None

    def __init__(self, end_site: int, nv: int, cost: float = 1.0, gain: float = 1.0) -> None:
        super().__init__(cost=np.full(2, cost), gain=gain)
        self._site = end_site
        self._jacp = np.zeros((3, nv))
        self._jacr = np.zeros((3, nv))
        self._turned = np.zeros((2, 3))
        self.target = np.zeros(3)

    def __getstate__(self) -> dict[str, object]:
        """All but the views of a configuration's data."""
        return {name: value for name, value in vars(self).items() if name not in _VIEWS}

    def compute_error(self, configuration: mink.Configuration) -> Array:
        """e_N (2,) [m]."""
        self._look_at(configuration)
        error: Array = self._N.copy() @ (self._p - self.target)
        return error

    def compute_jacobian(self, configuration: mink.Configuration) -> Array:
        """J_rcm (2, nv) [m/rad]."""
        self._look_at(configuration)
        N, turned = self._N.copy(), self._turned
        depth = self._d @ (self._p - self.target)
        mujoco.mj_jacSite(configuration.model, configuration.data, self._jacp, self._jacr, self._site)
        np.negative(N[1], out=turned[0])
        turned[1] = N[0]
        jacobian: Array = N @ self._jacp + depth * (turned @ self._jacr)
        return jacobian

    def _look_at(self, configuration: mink.Configuration) -> None:
        """Make views of what is read of a configuration's data: N, d and p, once for all its states."""
        data = configuration.data
        if data is not self._data:
            turn = data.site_xmat[self._site].reshape(3, 3)
            self._N, self._d = turn[:, :2].T, turn[:, 2]
            self._p, self._data = data.site_xpos[self._site], data


class LimitRows(mink.Limit):  # type: ignore[misc]
    """The rows of mink's `VelocityLimit` and `ConfigurationLimit` in one piece, G dq <= h.

    Both make all of them anew at every tick. What changes is the room to the position limits alone:
    h = gain (q_max - q), gain (q - q_min).

    Args:
        model: Of the arm; its joints are hinges or slides.
        speeds: Largest velocity of each joint by its name [rad/s].
        gain: How much of the room to a position limit a joint may take in a period, at most 1.
        dt_s: Control period [s].
        q: Joint positions (n,) [rad], at every tick in the same place.
    """

    def __init__(
        self, model: mujoco.MjModel, speeds: Mapping[str, float], gain: float, dt_s: float, q: Array
    ) -> None:
        configuration = mink.Configuration(model)
        position = mink.ConfigurationLimit(model, gain=gain)
        limits = (mink.VelocityLimit(model, speeds), position)
        rows = [limit.compute_qp_inequalities(configuration, dt_s) for limit in limits]
        self._G = np.vstack([row.G for row in rows if not row.inactive])
        self._h = np.hstack([row.h for row in rows if not row.inactive])
        self._gain, self._q, self._joints = gain, q, np.array(position.indices, dtype=np.int64)
        self._lower, self._upper = position.lower[self._joints], position.upper[self._joints]
        m = self._joints.size
        self._above, self._below = self._h[-2 * m : -m], self._h[self._h.size - m :]

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> mink.Constraint:
        """G (k, n) and h (k,) [rad], for the positions at `q`."""
        q = self._q[self._joints]
        np.multiply(self._gain, self._upper - q, out=self._above)
        np.multiply(self._gain, q - self._lower, out=self._below)
        return mink.Constraint(G=self._G, h=self._h)
