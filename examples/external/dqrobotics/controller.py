"""DQ Robotics: a quadratic program for the tip, the RCM as a vector-field inequality; joint velocities.

The square D of the trocar's distance from the shaft's line obeys D' <= eta (D_safe - D): the shaft may move
inside a tube around the trocar, and never leaves it (Marinho et al. 2019). Its kinematics are DQ Robotics'
own of the KUKA LWR4+, so it is for that arm alone; what they give is held against what surgsim tells at the
first tick.
"""

import sys
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

sys.path.insert(0, str(Path(__file__).parents[1]))
import numpy as np
from dqrobotics import DQ, k_, normalize, rotation, translation, vec4
from dqrobotics.robot_control import ControlObjective, DQ_ClassicQPController
from dqrobotics.robot_modeling import DQ_Kinematics
from dqrobotics.robots import KukaLw4Robot
from dqrobotics.solvers import DQ_QuadprogSolver
from shaft import K_PER_S, serve

SAFE_M = 2e-5
ETA_PER_S = 20.0
DAMPING = 1e-4
MOST_APART_M = 1e-6


def start(arm, gives):
    """Make the program; the answer is a solve a tick."""
    if gives != "joint_velocity":
        sys.exit("this adapter gives joint velocities: use the controller external_velocity")
    robot, n = KukaLw4Robot.kinematics(), len(arm["joints"])
    base = ElementTree.fromstring(arm["mjcf"]).find("worldbody/body")
    place = pose(numbers(base.get("pos")), DQ(numbers(base.get("quat"))))
    robot.set_base_frame(place)
    robot.set_reference_frame(place)
    solver = DQ_QuadprogSolver()
    controller = DQ_ClassicQPController(robot, solver)
    controller.set_control_objective(ControlObjective.Translation)
    controller.set_gain(K_PER_S)
    controller.set_damping(DAMPING)
    controller.set_stability_threshold(0.0)
    begun = False

    def answer(seen):
        nonlocal begun
        q = seen["q"].copy()
        if not begun:
            begun = True
            tip = pose(seen["p_WT"], turn_of(seen["R_WT"]))
            robot.set_effector(normalize(robot.fkm(q).conj() * tip))
            check(robot, q, seen)
        x = robot.fkm(q)
        turn, p = rotation(x), translation(x)
        axis = turn * k_ * turn.conj()
        line = axis + DQ([0.0, 0.0, 0.0, 0.0, *vec4(crossed(p, axis))])
        J_line = DQ_Kinematics.line_jacobian(robot.pose_jacobian(q), x, k_)
        port, moving = point(seen["p_WC"]), point(seen["v_WC"])
        D = square_distance(line, port)
        J_D = DQ_Kinematics.line_to_point_distance_jacobian(J_line, line, port)
        residual = DQ_Kinematics.line_to_point_residual(line, port, moving)
        rows = np.vstack([J_D.reshape(1, n), np.eye(n), -np.eye(n)])
        room = np.concatenate([[ETA_PER_S * (SAFE_M**2 - D) - residual], seen["upper"], -seen["lower"]])
        controller.set_inequality_constraint(rows, room)
        wanted, moved = vec4(point(seen["p_WTd"])), vec4(point(seen["v_WTd"]))
        return controller.compute_tracking_control_signal(q, wanted, moved)

    answer.solver = solver  # the controller alone does not keep it alive
    return answer


def check(robot, q, seen):
    """Refuse an arm that is not the library's: its joints move the tip otherwise."""
    J = DQ_Kinematics.translation_jacobian(robot.pose_jacobian(q), robot.fkm(q))[1:]
    apart = np.abs(J - seen["Jv_WT"]).max()
    if apart > MOST_APART_M:
        sys.exit(f"the arm is not DQ Robotics' KUKA LWR4+: the tip's Jacobian differs by {apart:.2g} m/rad")


def square_distance(line, p):
    """D of the point `p` from a line: |m - p x l|^2 [m^2], with l along the line and m its moment."""
    along, moment = line.vec8()[1:4], line.vec8()[5:8]
    return float(np.sum((moment - np.cross(p.vec4()[1:], along)) ** 2))


def crossed(a, b):
    """A x b of pure quaternions."""
    return DQ([0.0, *np.cross(vec4(a)[1:], vec4(b)[1:])])


def point(p):
    """A place as a pure quaternion."""
    return DQ([0.0, *p])


def pose(p, turn):
    """The unit dual quaternion of a place and a rotation."""
    half = 0.5 * point(p) * turn
    return DQ([*vec4(turn), *vec4(half)])


def turn_of(R):
    """The unit quaternion of a rotation matrix (3, 3)."""
    K = np.array(
        [
            [R[0, 0] + R[1, 1] + R[2, 2], R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
            [0.0, R[0, 0] - R[1, 1] - R[2, 2], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]],
            [0.0, 0.0, R[1, 1] - R[0, 0] - R[2, 2], R[1, 2] + R[2, 1]],
            [0.0, 0.0, 0.0, R[2, 2] - R[0, 0] - R[1, 1]],
        ]
    )
    _, vectors = np.linalg.eigh(K + np.triu(K, 1).T)
    return DQ(vectors[:, -1])


def numbers(text):
    """The numbers of a text."""
    return [float(word) for word in text.split()]


if __name__ == "__main__":
    serve("DQ Robotics QP with a vector-field inequality", version("dqrobotics"), start)
