"""An arm in MuJoCo under a torque law and a disturbance, and rows of RCM and tip that are written anew."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from surgsim.contract.problems import torque_problem
from surgsim.control.manipulability import velocity_product_accelerations
from surgsim.control.rcm import rcm_kinematics
from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig


@dataclass(frozen=True, kw_only=True)
class Rows:
    """Tip rows, then RCM rows: J (5, n), and e, e' and J' q' less the reference's acceleration (5,)."""

    J: np.ndarray
    error: np.ndarray
    rate: np.ndarray
    bias: np.ndarray


def rows_of(p, trocar=True):
    """The RCM's by the derivative of N (p_WT - p_WC) as a three-vector, seen along the law's two normals."""
    linear, angular = velocity_product_accelerations(p.kin, p.v)
    J, command = p.kin.Jv_WT, p.command
    tip = (J, p.kin.p_WT - command.p_WTd, J @ p.v - command.v_WTd, linear - command.a_WTd)
    if not trocar:
        return Rows(J=tip[0], error=tip[1], rate=tip[2], bias=tip[3])
    z, gap, omega = p.kin.R_WT[:, 2], p.kin.p_WT - p.p_WC, p.kin.Jw_WT @ p.v
    s, turned = z @ gap, np.array([np.cross(column, z) for column in p.kin.Jw_WT.T]).T
    z_dot, z_ddot = turned @ p.v, np.cross(angular, z) + np.cross(omega, np.cross(omega, z))
    s_dot = z_dot @ gap + z @ (J @ p.v - p.v_WC)
    shaft = J - s * turned
    B = p.rcm.normals
    rcm = (
        B @ shaft,
        B @ gap,
        B @ (shaft @ p.v - p.v_WC),
        B @ (linear - s * z_ddot - 2.0 * s_dot * z_dot - p.a_WC),
    )
    both = [np.concatenate(pair) for pair in zip(tip, rcm, strict=True)]
    return Rows(J=both[0], error=both[1], rate=both[2], bias=both[3])


def nearest(M, J, a, posture):
    """The q'' with J q'' = a that is nearest to `posture` in the norm of M, by its KKT system."""
    n, m = posture.size, a.size
    system = np.block([[M, J.T], [J, np.zeros((m, m))]])
    return np.linalg.solve(system, np.concatenate([M @ posture, a]))[:n]


def held(arm, config, ticks, disturbance, *, seed=0, start=None):
    """Run the law for `ticks` of 1 ms about a command that stands still; problems, terms and memories.

    Args:
        arm: Of the Panda.
        config: The law's.
        ticks: How many.
        disturbance: Joint torque (n,) [N m] at a problem and a time [s].
        seed: Of state and command.
        start: Changes of the first problem.
    """
    scene = build(SceneConfig(robot=RobotConfig(name="panda"), theatre=False))
    scene.model.opt.timestep = 0.001
    data, law = mujoco.MjData(scene.model), config.build(arm)
    p = torque_problem(arm, seed)
    n, still = p.q.size, np.zeros(3)
    command = replace(p.command, p_WTd=p.kin.p_WT, v_WTd=still, a_WTd=still)
    p = replace(p, v=np.zeros(n), q_ref=p.q, v_WC=still, a_WC=still, command=command)
    p = replace(p, resolution=replace(p.resolution, qdot=np.zeros(n)), **(start or {}))
    data.qpos[scene.qpos_ids], data.qvel[scene.dof_ids] = p.q, p.v
    memory, story = None, []
    for k in range(ticks):
        q, v = data.qpos[scene.qpos_ids].copy(), data.qvel[scene.dof_ids].copy()
        kin, _ = arm.evaluate(q, v)
        rcm = rcm_kinematics(kin, p.p_WC, p.v_WC)
        p = replace(p, q=q, v=v, kin=kin, dyn=arm.dynamics(q, v), rcm=rcm, t_s=0.001 * k)
        before = memory
        terms, memory = law.torque(p, memory)
        story.append((p, terms, before, memory))
        push = disturbance(p, 0.001 * k)
        data.qfrc_applied[scene.dof_ids] = terms.sum(axis=0) + push
        mujoco.mj_step(scene.model, data)
    return story
