"""The nominal arm as text for other libraries: MJCF and URDF, of the compiled model to the last bit.

Both hold the bodies, joints, limits and inertias and the frame of the tip, and nothing to be looked at: no
file beside them is needed. World frame: that of the scene.
"""

from collections.abc import Mapping

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.arm import ArmModel

TIP = "tip"
"""Frame of the tip in the URDF, and its site in the MJCF; z is the shaft axis."""
_NOTHING: Mapping[str, Array] = {}


def mjcf_of(arm: ArmModel) -> str:
    """The arm as MJCF: MuJoCo makes the same model of it."""
    model = arm.scene.model
    lines = [
        '<mujoco model="arm">',
        '<compiler angle="radian" autolimits="false" inertiafromgeom="false"/>',
        f'<option timestep="{model.opt.timestep:.17g}" gravity="{_text(model.opt.gravity)}"/>',
        "<worldbody>",
        *_children(model, 0),
        "</worldbody>",
        "<actuator>",
    ]
    for i, limit in enumerate(arm.limits.torque):
        lines.append(
            f'<motor name="motor{i + 1}" joint={_quoted(_joint(model, i))} ctrllimited="true" '
            f'ctrlrange="{-limit:.17g} {limit:.17g}"/>'
        )
    return "\n".join([*lines, "</actuator>", "</mujoco>"])


def _children(model: mujoco.MjModel, parent: int) -> list[str]:
    """The bodies below one, with all that is in them."""
    lines: list[str] = []
    for body in range(1, model.nbody):
        if model.body_parentid[body] != parent:
            continue
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or f"body{body}"
        place = f'pos="{_text(model.body_pos[body])}" quat="{_text(model.body_quat[body])}"'
        lines.append(f"<body name={_quoted(name)} {place}>")
        if model.body_mass[body] > 0.0:
            lines.append(
                f'<inertial pos="{_text(model.body_ipos[body])}" quat="{_text(model.body_iquat[body])}" '
                f'mass="{model.body_mass[body]:.17g}" diaginertia="{_text(model.body_inertia[body])}"/>'
            )
        for i in range(model.njnt):
            if model.jnt_bodyid[i] == body:
                lines.append(_mjcf_joint(model, i))
        for site in range(model.nsite):
            if model.site_bodyid[site] == body:
                named = _quoted(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SITE, site) or f"site{site}")
                where = f'pos="{_text(model.site_pos[site])}" quat="{_text(model.site_quat[site])}"'
                lines.append(f"<site name={named} {where}/>")
        lines += [*_children(model, body), "</body>"]
    return lines


def _mjcf_joint(model: mujoco.MjModel, i: int) -> str:
    """A hinge, its damping and the inertia of its motor."""
    dof = model.jnt_dofadr[i]
    return (
        f'<joint name={_quoted(_joint(model, i))} type="hinge" pos="{_text(model.jnt_pos[i])}" '
        f'axis="{_text(model.jnt_axis[i])}" limited="true" range="{_text(model.jnt_range[i])}" '
        f'damping="{model.dof_damping[dof]:.17g}" armature="{model.dof_armature[dof]:.17g}"/>'
    )


def urdf_of(arm: ArmModel, fixed: Mapping[str, Array] = _NOTHING) -> str:
    """The arm as URDF: `world`, a link for each joint, and `tip`; joints are named joint1, joint2, and so on.

    URDF knows no armature: the inertia of the motors is not in it.

    Args:
        arm: The arm.
        fixed: Further frames that do not move, by name: their places (3,) [m] in the world.
    """
    model, limits = arm.scene.model, arm.limits
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    moving = _moved_by(model)
    lines = ['<robot name="arm">', '<link name="world"/>']
    parent, at, turn = "world", np.zeros(3), np.eye(3)
    for i in range(model.njnt):
        joint, link = f"joint{i + 1}", f"link{i + 1}"
        R = data.xmat[model.jnt_bodyid[i]].reshape(3, 3)
        where = _origin(at, turn, data.xanchor[i], R)
        span = f'lower="{limits.q_min[i]:.17g}" upper="{limits.q_max[i]:.17g}"'
        speed = f'velocity="{limits.velocity[i]:.17g}" effort="{limits.torque[i]:.17g}"'
        bodies = [body for body in range(1, model.nbody) if moving[body] == i]
        lines += [
            f'<link name="{link}">{_inertial(model, data, bodies, data.xanchor[i], R)}</link>',
            f'<joint name="{joint}" type="revolute"><parent link="{parent}"/><child link="{link}"/>{where}'
            f'<axis xyz="{_text(model.jnt_axis[i])}"/><limit {span} {speed}/></joint>',
        ]
        parent, at, turn = link, data.xanchor[i], R
    site = arm.scene.tip_site
    tip = _origin(at, turn, data.site_xpos[site], data.site_xmat[site].reshape(3, 3))
    lines += _fixed(TIP, parent, tip)
    for name, p in fixed.items():
        lines += _fixed(name, "world", _origin(np.zeros(3), np.eye(3), p, np.eye(3)))
    return "\n".join([*lines, "</robot>"])


def _moved_by(model: mujoco.MjModel) -> list[int]:
    """For each body the joint that it turns with, -1 for one that does not move."""
    moving = [-1] * model.nbody
    for body in range(1, model.nbody):
        own = [i for i in range(model.njnt) if model.jnt_bodyid[i] == body]
        moving[body] = own[-1] if own else moving[model.body_parentid[body]]
    return moving


def _inertial(model: mujoco.MjModel, data: mujoco.MjData, bodies: list[int], p: Array, R: Array) -> str:
    """Mass, centre and inertia of all that turns with a joint, in the frame of its link."""
    mass = float(sum(model.body_mass[body] for body in bodies))
    if mass <= 0.0:
        return ""
    centre = sum((model.body_mass[body] * data.xipos[body] for body in bodies), np.zeros(3)) / mass
    about = np.zeros((3, 3))
    for body in bodies:
        turn, d = data.ximat[body].reshape(3, 3), data.xipos[body] - centre
        about += turn @ np.diag(model.body_inertia[body]) @ turn.T
        about += model.body_mass[body] * (d @ d * np.eye(3) - np.outer(d, d))
    own = R.T @ about @ R
    entries = zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), own[np.triu_indices(3)], strict=True)
    values = " ".join(f'{name}="{value:.17g}"' for name, value in entries)
    origin = f'<origin xyz="{_text(R.T @ (centre - p))}" rpy="0 0 0"/>'
    return f'<inertial>{origin}<mass value="{mass:.17g}"/><inertia {values}/></inertial>'


def _fixed(name: str, parent: str, where: str) -> list[str]:
    """A frame that is fixed to a link."""
    joint = f'<joint name="to_{name}" type="fixed"><parent link="{parent}"/><child link="{name}"/>'
    return [f'<link name="{name}"/>', f"{joint}{where}</joint>"]


def _origin(p: Array, R: Array, p_child: Array, R_child: Array) -> str:
    """The child's place in its parent, with roll, pitch and yaw."""
    A = R.T @ R_child
    pitch = np.arctan2(-A[2, 0], np.hypot(A[0, 0], A[1, 0]))
    if np.hypot(A[0, 0], A[1, 0]) > 1e-9:
        roll, yaw = np.arctan2(A[2, 1], A[2, 2]), np.arctan2(A[1, 0], A[0, 0])
    else:
        roll, yaw = np.arctan2(-A[1, 2], A[1, 1]), 0.0
    return f'<origin xyz="{_text(R.T @ (p_child - p))}" rpy="{_text(np.array([roll, pitch, yaw]))}"/>'


def _joint(model: mujoco.MjModel, i: int) -> str:
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, i) or f"joint{i + 1}"


def _text(values: Array) -> str:
    return " ".join(f"{value:.17g}" for value in values)


def _quoted(name: str) -> str:
    """A name as the value of an attribute."""
    from xml.sax.saxutils import quoteattr  # it brings http and ssl, which take 0.1 s to import

    return quoteattr(name)
