"""TSID: task-space inverse dynamics of the tip and of the shaft's direction, over a posture; joint torques.

Where tip and trocar are known, the direction of the shaft is: z = (p - C) / |p - C|. So the pose of the tip
but for the turn about the shaft is one task of TSID, with its velocity and acceleration fed forward.
"""

import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
import numpy as np
import pinocchio
from shaft import serve

for folder in map(Path, sys.path):  # the wheel keeps its module in a folder of its own
    for place in folder.glob("tsid/**/tsid_pywrap*.so"):
        sys.path.append(str(place.parent))
tsid = import_module("tsid_pywrap")

TIP_PER_S2, POSTURE_PER_S2 = 1e4, 400.0


def start(arm, gives):
    """Make the formulation; the answer is a solve a tick."""
    if gives != "joint_torque":
        sys.exit("TSID gives joint torques: use the controller external_torque")
    model = pinocchio.buildModelFromXML(arm["urdf"])
    model.armature = np.array(arm["armature_kg_m2"])  # URDF knows none
    robot = tsid.RobotWrapper(model, tsid.FIXED_BASE_SYSTEM, False)
    formulation = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
    tip = tsid.TaskSE3Equality("tip", robot, "tip")
    tip.setMask(np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0]))
    tip.setKp(TIP_PER_S2 * np.ones(6))
    tip.setKd(2.0 * np.sqrt(TIP_PER_S2) * np.ones(6))
    posture = tsid.TaskJointPosture("posture", robot)
    posture.setKp(POSTURE_PER_S2 * np.ones(model.nv))
    posture.setKd(2.0 * np.sqrt(POSTURE_PER_S2) * np.ones(model.nv))
    formulation.addMotionTask(tip, 1.0, 1, 0.0)
    formulation.addMotionTask(posture, 1e-6, 1, 0.0)
    solver, sized = tsid.SolverHQuadProgFast("solver"), False
    aim, rest = tsid.TrajectorySample(12, 6), tsid.TrajectorySample(model.nv)

    def answer(seen):
        nonlocal sized
        q, v = seen["q"].copy(), seen["v"].copy()
        place, velocity, acceleration = shaft_motion(seen)
        aim.value(place)
        aim.derivative(velocity)
        aim.second_derivative(acceleration)
        tip.setReference(aim)
        rest.value(seen["q_ref"].copy())
        rest.derivative(seen["qdot_ref"].copy())
        posture.setReference(rest)
        problem = formulation.computeProblemData(float(seen["t_s"]), q, v)
        if not sized:
            solver.resize(formulation.nVar, formulation.nEq, formulation.nIn)
            sized = True
        solution = solver.solve(problem)
        if solution.status != 0:
            return None
        return formulation.getActuatorForces(solution) + np.array(arm["damping_nm_s_per_rad"]) * v

    answer.kept = model, robot  # the formulation alone does not keep them alive
    return answer


def shaft_motion(seen):
    """Place (3) and rotation (9, by columns) of the tip, velocity (6,) and acceleration (6,) in the world."""
    p, v, a = seen["p_WTd"], seen["v_WTd"], seen["a_WTd"]
    d, d1, d2 = p - seen["p_WC"], v - seen["v_WC"], a - seen["a_WC"]
    length = np.linalg.norm(d)
    z = d / length
    speed = z @ d1
    z1 = (d1 - z * speed) / length
    z2 = (d2 - 2.0 * z1 * speed - z * (z1 @ d1 + z @ d2)) / length
    w, w1 = np.cross(z, z1), np.cross(z, z2)
    R = turned(seen["R_WT"], z)
    return np.concatenate([p, R.T.ravel()]), np.concatenate([v, w]), np.concatenate([a, w1])


def turned(R, z):
    """`R` (3, 3) turned the shortest way to have `z` as its third column."""
    axis, cosine = np.cross(R[:, 2], z), float(R[:, 2] @ z)
    S = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return (np.eye(3) + S + S @ S / (1.0 + cosine)) @ R


if __name__ == "__main__":
    serve("TSID", version("tsid"), start)
