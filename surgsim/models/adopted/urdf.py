"""URDF files: what MuJoCo's reader drops or does not find is looked up in the text.

MuJoCo reads URDF, but neither velocity limits nor `package://` paths, and takes no COLLADA meshes. A file of
xacro macros is no URDF yet.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from surgsim.models.adopted.problem import AdoptionError

_XACRO = "http://www.ros.org/wiki/xacro"
_KNOWN_MESHES = (".stl", ".obj", ".msh")
_PACKAGE = "package://"


@dataclass(frozen=True, kw_only=True)
class Urdf:
    """A URDF whose text MuJoCo can read.

    Attributes:
        text: The text, with every mesh's whole path.
        velocity: Joint to its largest speed [rad/s].
        effort: Joint to its largest torque [N m].
        meshes: Files that it uses.
        undrawn: Mesh files that are left out: of another kind, or not there.
    """

    text: str
    velocity: dict[str, float]
    effort: dict[str, float]
    meshes: tuple[Path, ...]
    undrawn: tuple[str, ...] = field(default=())


def read_urdf(path: Path) -> Urdf:
    """The URDF file at `path`.

    Raises:
        AdoptionError: If it is no URDF, or is made of xacro macros.
    """
    try:
        content = path.read_bytes()
        root = ET.fromstring(content)
    except OSError as error:
        raise AdoptionError(f"{path} cannot be read: {error.strerror}", "urdf") from error
    except ET.ParseError as error:
        raise AdoptionError(f"{path} is no XML: {error}", "urdf") from error
    if root.tag != "robot":
        hint = "; give an MJCF file as mjcf" if root.tag == "mujoco" else ""
        raise AdoptionError(f"{path} is no URDF: its first element is <{root.tag}>{hint}", "urdf")
    if path.suffix == ".xacro" or any(element.tag.startswith(f"{{{_XACRO}}}") for element in root.iter()):
        raise AdoptionError(
            f"{path} is made of xacro macros; write the URDF first: xacro {path.name} > "
            f"{path.name.split('.')[0]}.urdf",
            "urdf",
        )
    meshes, undrawn = _find_meshes(root, path)
    _keep_bodies_apart(root)
    limits = dict(_limits(root))
    return Urdf(
        text=ET.tostring(root, encoding="unicode"),
        velocity={name: limit[0] for name, limit in limits.items() if limit[0] > 0.0},
        effort={name: limit[1] for name, limit in limits.items() if limit[1] > 0.0},
        meshes=meshes,
        undrawn=undrawn,
    )


def _limits(root: ET.Element) -> Iterator[tuple[str, tuple[float, float]]]:
    """Name, largest speed [rad/s] and torque [N m] of every joint; 0 where there is none."""
    for joint in root.findall("joint"):
        limit = joint.find("limit")
        name = joint.get("name", "")
        values = (0.0, 0.0)
        if limit is not None:
            values = _number(name, limit, "velocity"), _number(name, limit, "effort")
        yield name, values


def _number(joint: str, element: ET.Element, key: str) -> float:
    """A limit; 0 where there is none.

    Raises:
        AdoptionError: If it is no finite number, or below 0.
    """
    text = element.get(key, "0")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= 0.0):
        raise AdoptionError(f"joint '{joint}': {key}=\"{text}\" is no limit: a number, 0 or more", "urdf")
    return value


def _find_meshes(root: ET.Element, path: Path) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Give every mesh its whole path, and take shapes away whose mesh cannot be read."""
    compiler = root.find("mujoco/compiler")
    folder = "" if compiler is None else compiler.get("meshdir", "")
    used: list[Path] = []
    undrawn: list[str] = []
    for link in root.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            for mesh in shape.iter("mesh"):
                name = mesh.get("filename", "")
                found = _place(name, path, folder)
                if found is None or found.suffix.lower() not in _KNOWN_MESHES:
                    link.remove(shape)
                    undrawn.append(name)
                    break
                mesh.set("filename", str(found))
                used.append(found)
    return tuple(sorted(set(used))), tuple(dict.fromkeys(undrawn))


def _place(name: str, path: Path, folder: str) -> Path | None:
    """Where a mesh is: in the file's folder, its `folder`, or of `package://` beside those above it."""
    if not name.startswith(_PACKAGE):
        for place in (path.parent / name.removeprefix("file://"), path.parent / folder / name):
            if place.is_file():
                return place.resolve()
        return None
    package, _, rest = name.removeprefix(_PACKAGE).partition("/")
    for above in path.resolve().parents:
        for inside in (above / package / rest, above / rest):
            if inside.is_file() and package in inside.parts:
                return inside
    return None


def _keep_bodies_apart(root: ET.Element) -> None:
    """Ask MuJoCo to keep links on fixed joints, drawn shapes and whole paths."""
    block = root.find("mujoco")
    block = ET.SubElement(root, "mujoco") if block is None else block
    compiler = block.find("compiler")
    compiler = ET.SubElement(block, "compiler") if compiler is None else compiler
    compiler.attrib.pop("meshdir", None)  # meshes have whole paths by now
    for key, value in {"strippath": "false", "fusestatic": "false", "discardvisual": "false"}.items():
        compiler.set(key, value)
