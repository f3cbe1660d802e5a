"""pink: tip a task, the RCM a constraint, limits of position and speed, by daqp; joint velocities."""

import sys
from importlib.metadata import version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
import numpy as np
import pinocchio
from pink import Configuration, solve_ik
from pink.tasks import FrameTask, Task
from shaft import next_target, rcm_reached, serve, trocar_in_tip


class Rcm(Task):
    """The trocar's x and y in the frame of the tip, r = R^T (C - p): both zero."""

    def __init__(self, frame):
        super().__init__(cost=1.0, gain=1.0)
        self.frame, self.r, self.moved = frame, np.zeros(3), np.zeros(2)

    def __repr__(self):
        return f"Rcm(frame={self.frame})"

    def compute_error(self, configuration):
        """What is to go of the shaft's distance from the trocar in this period (2,) [m]."""
        return self.moved

    def compute_jacobian(self, configuration):
        """How r changes with the joints (2, n): r' = -v + S(r) w, both in the frame of the tip."""
        data, r = configuration.data, self.r
        J = pinocchio.getFrameJacobian(configuration.model, data, self.frame, pinocchio.ReferenceFrame.LOCAL)
        return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]]]) @ J[3:] - J[:2]


def start(arm, gives):
    """Load the arm; the answer is a solve a tick."""
    if gives != "joint_velocity":
        sys.exit("pink gives joint velocities: use the controller external_velocity")
    model = pinocchio.buildModelFromXML(arm["urdf"])
    frame = model.getFrameId("tip")
    configuration = Configuration(model, model.createData(), pinocchio.neutral(model))
    tip, rcm = FrameTask("tip", position_cost=1.0, orientation_cost=0.0), Rcm(frame)

    def answer(seen):
        dt = float(seen["dt_s"])
        configuration.update(seen["q"].copy())
        tip.set_target(pinocchio.SE3(seen["R_WT"].copy(), next_target(seen)))
        moved = seen["R_WT"].T @ seen["v_WC"] * dt
        rcm.r = trocar_in_tip(seen)
        rcm.moved = rcm_reached(seen) * rcm.r[:2] + moved[:2]
        return solve_ik(configuration, [tip], dt, "daqp", damping=1e-9, constraints=[rcm])

    return answer


if __name__ == "__main__":
    serve("pink", version("pin-pink"), start)
