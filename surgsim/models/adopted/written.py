"""An arm from a file as a robot's folder: its MJCF with every digit, and its meshes."""

import re
import struct
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.adopted.surface import Surface

MESHES = "meshes"


def mjcf_text(
    spec: mujoco.MjSpec, name: str, surfaces: dict[str, list[Surface]], remarks: Sequence[str]
) -> str:
    """The text of an arm's MJCF.

    MuJoCo's own writer keeps six digits of a number; here each is written so that it is read back as it was.

    Args:
        spec: The arm in the package's form, without what is only looked at.
        name: What the arm is called.
        surfaces: What is drawn of each body; the meshes are files `mesh_name` in the folder `meshes`.
        remarks: Lines that stand at the top.
    """
    root = ET.Element("mujoco", model=name)
    root.append(ET.Comment("\n" + "".join(f"    {re.sub('--+', '-', line)}\n" for line in remarks) + "  "))
    ET.SubElement(root, "compiler", angle="radian", autolimits="true", meshdir=MESHES)
    custom = ET.SubElement(root, "custom")
    for text in spec.texts:
        ET.SubElement(custom, "text", name=text.name, data=str(text.data))
    for numeric in spec.numerics:
        ET.SubElement(custom, "numeric", name=numeric.name, size=str(numeric.size), data=_row(numeric.data))
    assets = ET.SubElement(root, "asset")
    for body, shapes in surfaces.items():
        for i in range(len(shapes)):
            mesh = mesh_name(body, i)
            ET.SubElement(assets, "mesh", name=mesh, file=f"{mesh}.stl", inertia="shell")
    _write_bodies(ET.SubElement(root, "worldbody"), spec.worldbody.bodies, surfaces)
    actuators = ET.SubElement(root, "actuator")
    for motor in spec.actuators:
        ET.SubElement(
            actuators, "motor", name=motor.name, joint=motor.target, ctrlrange=_row(motor.ctrlrange)
        )
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def mesh_name(body: str, i: int) -> str:
    """What the i-th drawn surface of a body is called."""
    return f"{body}_{i}"


def stl_bytes(surface: Surface) -> bytes:
    """A surface as a binary STL."""
    corners = surface.points[surface.faces].astype("<f4")
    record = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    record["corners"] = corners
    return bytes(80) + struct.pack("<I", len(corners)) + record.tobytes()


def _write_bodies(
    parent: ET.Element, bodies: Iterable[mujoco.MjsBody], surfaces: dict[str, list[Surface]]
) -> None:
    for body in bodies:
        element = ET.SubElement(parent, "body", name=body.name, pos=_row(body.pos), quat=_row(body.quat))
        if body.mass > 0.0:
            where = {"pos": body.ipos, "quat": body.iquat}
            inertial = {**where, "mass": [body.mass], "diaginertia": body.inertia}
            ET.SubElement(element, "inertial", {key: _row(value) for key, value in inertial.items()})
        for joint in body.joints:
            _write_joint(element, joint)
        for i, surface in enumerate(surfaces.get(body.name, ())):
            ET.SubElement(
                element,
                "geom",
                type="mesh",
                mesh=mesh_name(body.name, i),
                rgba=" ".join(f"{x:.4g}" for x in surface.rgba),
                contype="0",
                conaffinity="0",
                group="2",
                mass="0",
            )
        for site in body.sites:
            ET.SubElement(
                element, "site", name=site.name, pos=_row(site.pos), quat=_row(site.quat), group="4"
            )
        _write_bodies(element, body.bodies, surfaces)


def _write_joint(parent: ET.Element, joint: mujoco.MjsJoint) -> None:
    damping = np.ravel(joint.damping)[:1]
    values: dict[str, Array | Sequence[float]] = {
        "pos": joint.pos,
        "axis": joint.axis,
        "range": joint.range,
        "ref": [joint.ref],
        "damping": damping,
        "armature": [joint.armature],
        "frictionloss": [joint.frictionloss],
    }
    ET.SubElement(parent, "joint", {"name": joint.name, **{key: _row(v) for key, v in values.items()}})


def _row(values: Array | Sequence[float]) -> str:
    """Numbers with every digit."""
    return " ".join(repr(float(x)).removesuffix(".0") for x in values)


def model_files(
    spec: mujoco.MjSpec, name: str, surfaces: dict[str, list[Surface]], remarks: Sequence[str]
) -> dict[str, bytes]:
    """The files of an arm's model, by their place in the arm's folder; arguments as of `mjcf_text`."""
    files = {f"{name}.xml": mjcf_text(spec, name, surfaces, remarks).encode()}
    for body, shapes in surfaces.items():
        for i, surface in enumerate(shapes):
            files[f"{MESHES}/{mesh_name(body, i)}.stl"] = stl_bytes(surface)
    return files
