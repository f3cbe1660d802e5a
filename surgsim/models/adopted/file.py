"""An arm's file as a compiled model, with what stands in the file and not in the model."""

import hashlib
import os
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import mujoco

from surgsim.models.adopted.problem import AdoptionError, listed
from surgsim.models.adopted.urdf import read_urdf

Kind = Literal["mjcf", "urdf"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelFile:
    """What an arm's file holds.

    Attributes:
        path: The file.
        kind: Which language it is in.
        model: Compiled as it stands, links on fixed joints kept as bodies of their own.
        velocity: Joint to its largest speed [rad/s], where the file states it.
        effort: Joint to its largest torque [N m], where the file states it beside any actuator.
        undrawn: Mesh files that could not be read, and are left out.
    """

    path: Path
    kind: Kind
    model: mujoco.MjModel
    velocity: dict[str, float]
    effort: dict[str, float]
    undrawn: tuple[str, ...]


def kind_of(path: Path) -> Kind:
    """Which language a model file is in, by its first element.

    Raises:
        AdoptionError: If it is neither.
    """
    try:
        tag = ET.parse(path).getroot().tag
    except OSError as error:
        raise AdoptionError(f"{path} cannot be read: {error.strerror}") from error
    except ET.ParseError as error:
        raise AdoptionError(f"{path} is no XML: {error}") from error
    if tag not in ("mujoco", "robot"):
        raise AdoptionError(f"{path} is neither MJCF nor URDF: its first element is <{tag}>")
    return "mjcf" if tag == "mujoco" else "urdf"


def read_file(path: Path, kind: Kind) -> ModelFile:
    """Read and compile the model at `path`.

    Raises:
        AdoptionError: If it cannot be read.
    """
    if not path.is_file():
        what = "is a folder, not a file" if path.is_dir() else "does not exist"
        raise AdoptionError(f"{path} {what}", kind)
    if kind == "urdf":
        urdf = read_urdf(path)
        spec = _parsed(path, kind, urdf.text)
        velocity, effort, undrawn = urdf.velocity, urdf.effort, urdf.undrawn
    else:
        _check_mjcf(path)
        spec = _parsed(path, kind, None)
        velocity, effort, undrawn = {}, {}, _without_lost_meshes(spec)
        spec.compiler.fusestatic, spec.compiler.discardvisual = False, False
    try:
        model = spec.compile()
    except ValueError as error:
        raise AdoptionError(f"MuJoCo cannot compile {path}: {_first_line(error)}", kind) from error
    return ModelFile(path=path, kind=kind, model=model, velocity=velocity, effort=effort, undrawn=undrawn)


def files_sha256(path: Path, kind: Kind) -> str:
    """Hash of the file and of all files that it names: included ones and meshes.

    Raises:
        AdoptionError: If the file cannot be read.
    """
    named = list(read_urdf(path).meshes) if kind == "urdf" else _named_by(path)
    digest = hashlib.sha256()
    for file in (path, *sorted(set(named), key=lambda file: (file.name, str(file)))):
        try:
            content = file.read_bytes()
        except OSError as error:
            raise AdoptionError(f"{file} cannot be read: {error.strerror}", kind) from error
        digest.update(f"{file.name} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def _parsed(path: Path, kind: Kind, text: str | None) -> mujoco.MjSpec:
    try:
        return mujoco.MjSpec.from_file(str(path)) if text is None else mujoco.MjSpec.from_string(text)
    except (ValueError, OSError) as error:
        raise AdoptionError(f"MuJoCo cannot read {path}: {_first_line(error)}", kind) from error


def _check_mjcf(path: Path) -> None:
    """Refuse what is no MJCF in words of its own: MuJoCo tells URDF by its first element."""
    try:
        root = ET.parse(path).getroot()
    except OSError as error:
        raise AdoptionError(f"{path} cannot be read: {error.strerror}", "mjcf") from error
    except ET.ParseError as error:
        raise AdoptionError(f"{path} is no XML: {error}", "mjcf") from error
    if root.tag == "mujocoinclude":
        raise AdoptionError(f"{path} is a part that other MJCF files include: give the whole model", "mjcf")
    if root.tag != "mujoco":
        hint = "; give a URDF file as urdf" if root.tag == "robot" else ""
        raise AdoptionError(f"{path} is no MJCF: its first element is <{root.tag}>{hint}", "mjcf")


def _named_by(path: Path) -> list[Path]:
    """The files that an MJCF includes, and the meshes that it and they name, as far as they are there."""
    _check_mjcf(path)
    trees, included = [ET.parse(path).getroot()], []
    for tree in trees:
        for element in tree.iter("include"):
            file = path.parent / element.get("file", "")
            if file.is_file() and file not in included:
                included.append(file)
                trees.append(ET.parse(file).getroot())
    compilers = [compiler for tree in trees for compiler in tree.iter("compiler")]
    folders = [path.parent / (c.get("meshdir") or c.get("assetdir") or "") for c in compilers] or [
        path.parent
    ]
    meshes = [mesh.get("file") for tree in trees for mesh in tree.iter("mesh")]
    places = (folder / mesh for folder in folders for mesh in meshes if mesh)
    return [*included, *(place for place in places if place.is_file())]


def _mesh_files(spec: mujoco.MjSpec) -> list[Path]:
    folder = Path(spec.modelfiledir) / spec.meshdir
    return [folder / mesh.file for mesh in spec.meshes if mesh.file]


def _without_lost_meshes(spec: mujoco.MjSpec) -> tuple[str, ...]:
    """Take meshes away whose files are not there, and what is drawn with them; their files.

    Raises:
        AdoptionError: If a link's mass would be worked out from one.
    """
    files = {mesh.name: file for mesh, file in zip(_with_file(spec), _mesh_files(spec), strict=True)}
    lost = {name: file for name, file in files.items() if not file.is_file()}
    for geom in list(spec.geoms):
        if geom.meshname in lost:
            body = geom.parent
            if not body.explicitinertial and body.name != "world" and body.joints:
                raise AdoptionError(
                    f"the mesh {lost[geom.meshname]} is not there, and the mass of body '{body.name}' is to "
                    f"be worked out from it",
                    "mjcf",
                )
            spec.delete(geom)
    for mesh in list(spec.meshes):
        if mesh.name in lost:
            spec.delete(mesh)
    return tuple(os.path.relpath(file, spec.modelfiledir or ".") for file in lost.values())


def _with_file(spec: mujoco.MjSpec) -> Iterable[mujoco.MjsMesh]:
    return (mesh for mesh in spec.meshes if mesh.file)


def _first_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return "; ".join(lines[:2]) if lines else type(error).__name__


def joints_named(model: mujoco.MjModel) -> str:
    """The joints of a model, for a message."""
    return listed(model.joint(i).name for i in range(model.njnt))
