"""The form that every arm has: bodies, joints, motors, flange and limits under the package's names."""

from pathlib import Path

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.adopted.capsules import Capsule
from surgsim.models.adopted.findings import Findings
from surgsim.models.adopted.surface import Surface
from surgsim.models.adopted.turns import at_zero, quaternion_of

_OPTIONAL = ("jerk_limit_rad_per_s3", "torque_rate_limit_nm_per_s")


def mechanics_of(found: Findings, home: Array | None) -> mujoco.MjSpec:
    """Bodies, joints, motors, flange and limits, under the names that the package relies on."""
    model, limits, n = found.model, found.limits, found.n
    spec = mujoco.MjSpec()
    spec.modelname = _label(found.file.path)
    spec.compiler.degree = False
    spec.compiler.autolimits = True
    spec.compiler.balanceinertia = False
    body, above = spec.worldbody, None
    for i, (name, link) in enumerate(found.parts.items()):
        body = body.add_body(name=name)
        if above is not None:
            body.pos = above.R_WL.T @ (link.p_WL - above.p_WL)
            body.quat = quaternion_of(above.R_WL.T @ link.R_WL)
        set_inertia(body, link.mass, link.com, link.inertia, link.R_LI)
        if i > 0:
            _add_joint(body, found, i - 1)
        above = link
    p, R = flange_in_last_link(found)
    body.add_site(name="flange", pos=p, quat=quaternion_of(R), group=4)
    for i in range(n):
        motor = spec.add_actuator(name=f"motor{i + 1}", target=f"joint{i + 1}")
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.ctrlrange, motor.ctrllimited = [-limits.torque[i], limits.torque[i]], True
    _add_numeric(spec, "velocity_limit_rad_per_s", limits.velocity)
    _add_numeric(spec, "acceleration_limit_rad_per_s2", limits.acceleration)
    for name in _OPTIONAL:
        number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
        if number >= 0 and model.numeric_size[number] == n:
            _add_numeric(spec, name, np.array(model.numeric(name).data))
    if home is not None:
        _add_numeric(spec, "home_rad", home)
    return spec


def set_inertia(body: mujoco.MjsBody, mass: float, com: Array, inertia: Array, axes: Array) -> None:
    """Give a body its mass [kg], centre of mass (3,) [m], and moments (3,) [kg m²] along `axes` (3, 3)."""
    body.explicitinertial = True
    body.mass, body.ipos = mass, com
    if mass > 0.0:
        body.inertia, body.iquat = inertia, quaternion_of(axes)


def _add_joint(body: mujoco.MjsBody, found: Findings, i: int) -> None:
    model, joint = found.model, found.chain.joints[i]
    dof, zero = int(model.jnt_dofadr[joint]), float(model.qpos0[model.jnt_qposadr[joint]])
    body.add_joint(
        name=f"joint{i + 1}",
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=model.jnt_axis[joint],
        pos=model.jnt_pos[joint],
        range=found.limits.position[i],
        limited=True,
        ref=zero,
        armature=float(found.armature[i]),
        damping=float(model.dof_damping[dof]),
        frictionloss=float(model.dof_frictionloss[dof]),
    )


def write_capsules(spec: mujoco.MjSpec, capsules: dict[str, list[Capsule]]) -> None:
    """Put the capsules of each part into the arm."""
    for name, found in capsules.items():
        numbers = [np.append(capsule.ends.ravel(), capsule.radius) for capsule in found]
        if numbers:
            _add_numeric(spec, f"capsule_{name}", np.concatenate(numbers))


def draw(spec: mujoco.MjSpec, body: str, name: str, surface: Surface) -> None:
    """Let a surface be seen with `body`."""
    mesh = spec.add_mesh(name=name)
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    mesh.uservert = surface.points.ravel().tolist()
    mesh.userface = surface.faces.ravel().tolist()
    spec.body(body).add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        rgba=surface.rgba,
        contype=0,
        conaffinity=0,
        group=2,
        mass=0.0,
    )


def flange_in_last_link(found: Findings) -> tuple[Array, Array]:
    """Place (3,) [m] and axes (3, 3) of the flange in the last link's frame."""
    model, chain, last = found.model, found.chain, found.last
    data = at_zero(model)
    turn = data.xmat[chain.flange_body].reshape(3, 3)
    place = data.xpos[chain.flange_body] + turn @ chain.p_LF
    return last.to(place), last.R_WL.T @ turn @ chain.R_LF


def _label(path: Path) -> str:
    return "".join(c if c.isalnum() or c == "_" else "_" for c in path.stem) or "arm"


def _add_numeric(spec: mujoco.MjSpec, name: str, values: Array) -> None:
    spec.add_numeric(name=name, data=[float(x) for x in values], size=len(values))


def add_text(spec: mujoco.MjSpec, name: str, text: str) -> None:
    """Put a text into the arm."""
    spec.add_text(name=name, data=text)
