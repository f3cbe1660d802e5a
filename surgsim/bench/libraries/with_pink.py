"""pink: tip as a task, RCM as a constraint, on Pinocchio."""

from importlib.metadata import version

import numpy as np
import pinocchio
from pink import Configuration, solve_ik
from pink.tasks import FrameTask, Task

from surgsim.array import Array
from surgsim.bench.libraries.arm_files import TIP, urdf_of
from surgsim.bench.libraries.problem import Circle


class _Rcm(Task):  # type: ignore[misc]
    """The trocar's x and y in the frame of the tip, r = R^T (C - p): both zero."""

    def __init__(self, frame: int, p_WC: Array) -> None:
        super().__init__(cost=1.0, gain=1.0)
        self._frame, self._p_WC = frame, p_WC

    def __repr__(self) -> str:
        return f"_Rcm(frame={self._frame}, p_WC={self._p_WC})"

    def compute_error(self, configuration: Configuration) -> Array:
        """The shaft's distance from the trocar (2,) [m]."""
        return np.asarray(configuration.data.oMf[self._frame].actInv(self._p_WC)[:2])

    def compute_jacobian(self, configuration: Configuration) -> Array:
        """How it changes with the joints (2, n): r' = -v + S(r) w, both in the frame of the tip."""
        data, frame = configuration.data, self._frame
        r = data.oMf[frame].actInv(self._p_WC)
        J = pinocchio.getFrameJacobian(configuration.model, data, frame, pinocchio.ReferenceFrame.LOCAL)
        turned = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]]])
        return np.asarray(turned @ J[3:] - J[:2])


class Pink:
    """`solve_ik` with daqp, which its examples prefer, and its usual limits."""

    name = "pink"
    how = "daqp; tip a task, RCM hard rows, limits of position and speed"

    def __init__(self, circle: Circle) -> None:
        self.version = version("pin-pink")
        model = pinocchio.buildModelFromXML(urdf_of(circle.arm, circle.p_WC))
        self._frame, self._dt = model.getFrameId(TIP), circle.dt_s
        self._configuration = Configuration(model, model.createData(), circle.q_start)
        self._tip = FrameTask(TIP, position_cost=1.0, orientation_cost=0.0)
        self._rcm = _Rcm(self._frame, circle.p_WC)
        self._place = pinocchio.SE3.Identity()

    def tip(self, q: Array) -> Array:
        """See `Library`."""
        self._configuration.update(q)
        return np.array(self._configuration.data.oMf[self._frame].translation)

    def start(self, q: Array) -> None:
        """See `Library`."""
        self._configuration.update(q)

    def step(self, target: Array) -> Array:
        """See `Library`; the target turns with the tip, whose direction is free."""
        self._place.rotation = self._configuration.data.oMf[self._frame].rotation
        self._place.translation = target
        self._tip.set_target(self._place)
        tasks, hard = [self._tip], [self._rcm]
        velocity = solve_ik(self._configuration, tasks, self._dt, "daqp", damping=1e-9, constraints=hard)
        self._configuration.integrate_inplace(velocity, self._dt)
        return np.array(self._configuration.q)
