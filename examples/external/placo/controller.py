"""placo: tip a soft task, the RCM hard rows, limits of position and speed; joint velocities."""

import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
import numpy as np
import placo
from shaft import next_target, rcm_reached, serve, trocar_in_tip


def start(arm, gives):
    """Load the arm; the answer is a solve a tick."""
    if gives != "joint_velocity":
        sys.exit("placo's kinematics solver gives joint velocities: use the controller external_velocity")
    made = None

    def answer(seen):
        nonlocal made
        if made is None:
            made = Made(arm, seen["p_WC"])
        return made.step(seen)

    return answer


class Made:
    """The arm with the port where it is at the first tick, and the tasks."""

    def __init__(self, arm, port):
        self.joints, self.port = arm["urdf_joints"], port.copy()
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "robot.urdf"
            file.write_text(with_trocar(arm["urdf"], port), encoding="utf-8")
            self.robot = placo.RobotWrapper(str(file), placo.Flags.ignore_collisions)
        for name, limit in zip(self.joints, arm["velocity_max_rad_per_s"], strict=True):
            self.robot.set_velocity_limit(name, limit)
        self.solver = placo.KinematicsSolver(self.robot)
        self.solver.mask_fbase(True)
        self.solver.enable_joint_limits(True)
        self.solver.enable_velocity_limits(True)
        self.tip = self.solver.add_position_task("tip", np.zeros(3))
        self.tip.configure("tip", "soft", 1.0)
        self.rcm = self.solver.add_relative_position_task("tip", "trocar", np.zeros(3))
        self.rcm.mask.set_axises("xy")
        self.rcm.configure("rcm", "hard", 1.0)
        self.solver.add_regularization_task(1e-9)

    def step(self, seen):
        """Joint velocities (n,) [rad/s]."""
        self.solver.dt = float(seen["dt_s"])
        for name, value in zip(self.joints, seen["q"], strict=True):
            self.robot.set_joint(name, float(value))
        self.robot.update_kinematics()
        self.tip.target_world = next_target(seen)
        # The frame `trocar` does not move: what the port has moved is taken off its place in the tip.
        ahead = seen["p_WC"] + self.solver.dt * seen["v_WC"] - self.port
        kept = (1.0 - rcm_reached(seen)) * trocar_in_tip(seen)
        self.rcm.target = kept - seen["R_WT"].T @ ahead
        return self.solver.solve(False)[6:] / self.solver.dt


def with_trocar(urdf, p):
    """The arm with a frame `trocar` that is fixed at `p` (3,) [m] in the world."""
    joint = '<joint name="to_trocar" type="fixed"><parent link="world"/><child link="trocar"/>'
    where = f'<origin xyz="{" ".join(f"{x:.17g}" for x in p)}" rpy="0 0 0"/></joint>'
    return urdf.replace("</robot>", f'<link name="trocar"/>{joint}{where}</robot>')


if __name__ == "__main__":
    serve("placo KinematicsSolver", version("placo"), start)
