"""What an external controller is told first: the layout that is meant, and the arm."""

import json
from typing import Any

import numpy as np

from surgsim.control.external.layout import HELLO, VERSION, hello, layout_hash, reply, request
from surgsim.models.arm import ArmModel
from surgsim.models.robot import joint_names
from surgsim.models.texts import TIP, mjcf_of, urdf_of


def greeting(arm: ArmModel, gives: int) -> tuple[bytes, bytes]:
    """The hello and the JSON text that follows it."""
    text = json.dumps(arm_description(arm)).encode()
    head = np.zeros(1, hello().dtype)
    head["magic"], head["version"], head["hash"] = HELLO, VERSION, layout_hash()
    head["request_bytes"], head["reply_bytes"] = request().dtype.itemsize, reply().dtype.itemsize
    head["n"], head["gives"], head["text_bytes"] = arm.limits.q_min.size, gives, len(text)
    return head.tobytes(), text


def arm_description(arm: ArmModel) -> dict[str, Any]:
    """The nominal arm: joints, limits, drives, and its model as MJCF and URDF with the frame of the tip."""
    limits, drive = arm.limits, arm.drive
    names = ("stiffness", "apparent_inertia", "loop_damping", "torque_rate")
    return {
        "joints": list(joint_names(arm.scene.model)),
        "urdf_joints": [f"joint{i + 1}" for i in range(limits.q_min.size)],
        "tip": TIP,
        "q_min_rad": limits.q_min.tolist(),
        "q_max_rad": limits.q_max.tolist(),
        "velocity_max_rad_per_s": limits.velocity.tolist(),
        "acceleration_max_rad_per_s2": _finite(limits.acceleration),
        "torque_max_nm": limits.torque.tolist(),
        "armature_kg_m2": arm.scene.model.dof_armature.tolist(),
        "damping_nm_s_per_rad": arm.damping.tolist(),
        "drive": None if drive is None else {name: _finite(getattr(drive, name)) for name in names},
        "mjcf": mjcf_of(arm),
        "urdf": urdf_of(arm),
    }


def _finite(value: Any) -> Any:
    """As JSON can say it: null for what is infinite or unknown."""
    values = [float(x) if np.isfinite(x) else None for x in np.atleast_1d(value)]
    return values if np.ndim(value) else values[0]
