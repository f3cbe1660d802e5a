"""placo: tip and RCM as tasks of its kinematics solver."""

import tempfile
from importlib.metadata import version
from pathlib import Path

import numpy as np
import placo

from surgsim.array import Array
from surgsim.bench.libraries.arm_files import TIP, TROCAR, urdf_of
from surgsim.bench.libraries.problem import Circle


class Placo:
    """`KinematicsSolver`: the trocar's x and y in the frame of the tip are a hard task, which is the RCM."""

    name = "placo"
    how = "eiquadprog (its only one); tip a task, RCM hard rows, limits of position and speed"

    def __init__(self, circle: Circle) -> None:
        self.version = version("placo")
        self._joints = [f"joint{i + 1}" for i in range(circle.q_start.size)]
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "robot.urdf"
            file.write_text(urdf_of(circle.arm, circle.p_WC), encoding="utf-8")
            self._robot = placo.RobotWrapper(str(file), placo.Flags.ignore_collisions)
        solver = placo.KinematicsSolver(self._robot)
        solver.mask_fbase(True)
        solver.dt = circle.dt_s
        solver.enable_joint_limits(True)
        solver.enable_velocity_limits(True)
        self._tip = solver.add_position_task(TIP, circle.targets[0])
        self._tip.configure("tip", "soft", 1.0)
        rcm = solver.add_relative_position_task(TIP, TROCAR, np.zeros(3))
        rcm.mask.set_axises("xy")
        rcm.configure("rcm", "hard", 1.0)
        solver.add_regularization_task(1e-9)
        self._solver = solver

    def tip(self, q: Array) -> Array:
        """See `Library`."""
        self.start(q)
        return np.array(self._robot.get_T_world_frame(TIP)[:3, 3])

    def start(self, q: Array) -> None:
        """See `Library`."""
        for name, value in zip(self._joints, q, strict=True):
            self._robot.set_joint(name, float(value))
        self._robot.update_kinematics()

    def step(self, target: Array) -> Array:
        """See `Library`."""
        self._tip.target_world = target
        self._solver.solve(True)
        self._robot.update_kinematics()
        return np.array(self._robot.state.q[7:])
