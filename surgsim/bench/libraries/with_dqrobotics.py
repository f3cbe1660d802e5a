"""DQ Robotics: its kinematics and Jacobians of the tip and of the shaft's line."""

from importlib.metadata import version

import numpy as np
from dqrobotics import DQ, k_, normalize, rotation, translation, vec4
from dqrobotics.robots import KukaLw4Robot

from surgsim.array import Array
from surgsim.bench.libraries.arm_files import base_pose
from surgsim.bench.libraries.problem import Circle


class DqRobotics:
    """Rows of tip and line, solved at once with least norm.

    Its QP controller needs another package for the solver. The line's moment about the trocar, m - C x l, is
    zero when the shaft goes through it; two of its three rows count.
    """

    name = "dqrobotics"
    how = "translation and line Jacobians, least norm by numpy; no limits"

    def __init__(self, circle: Circle) -> None:
        self.version = version("dqrobotics")
        self._robot = KukaLw4Robot.kinematics()
        p, R = base_pose(circle.arm)
        self._robot.set_base_frame(_pose(p, R))
        self._robot.set_reference_frame(_pose(p, R))
        at = circle.arm.kinematics(circle.q_start)
        self._robot.set_effector(normalize(self._robot.fkm(circle.q_start).conj() * _pose(at.p_WT, at.R_WT)))
        self._p_WC = circle.p_WC
        C = circle.p_WC
        self._cross = np.array([[0.0, -C[2], C[1]], [C[2], 0.0, -C[0]], [-C[1], C[0], 0.0]])
        self._q = circle.q_start.copy()

    def tip(self, q: Array) -> Array:
        """See `Library`."""
        return np.array(vec4(translation(self._robot.fkm(q)))[1:])

    def start(self, q: Array) -> None:
        """See `Library`."""
        self._q = q.copy()

    def step(self, target: Array) -> Array:
        """See `Library`."""
        q, robot = self._q, self._robot
        x, J = robot.fkm(q), robot.pose_jacobian(q)
        turn, place = rotation(x), translation(x)
        axis = turn * k_ * turn.conj()
        p, d = vec4(place)[1:], vec4(axis)[1:]
        line = robot.line_jacobian(J, x, k_)
        normals = _normals(d)
        moment = np.cross(p - self._p_WC, d)
        rows = np.concatenate(
            (robot.translation_jacobian(J, x)[1:], normals @ (line[5:] - self._cross @ line[1:4]))
        )
        aim = np.concatenate((target - p, -(normals @ moment)))
        self._q = q + rows.T @ np.linalg.solve(rows @ rows.T, aim)
        return self._q


def _normals(d: Array) -> Array:
    """Two directions across `d` as rows (2, 3)."""
    least = np.eye(3)[np.argmin(np.abs(d))]
    first = np.cross(d, least)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(d, first)])


def _pose(p: Array, R: Array) -> DQ:
    """The unit dual quaternion of a place and a rotation matrix."""
    import mujoco

    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, R.ravel())
    turn = DQ(quaternion)
    return turn + DQ([0.0, 0.0, 0.0, 0.0, 0.0, *(0.5 * p)]) * turn
