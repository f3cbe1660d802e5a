"""An arm's file as a compiled model, with what stands in the file and not in the model."""

import hashlib
import os
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import mujoco

from surgsim.models.adopted.problem import AdoptionError
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
        velocity, effort, undrawn = {}, {}, ()
        spec.compiler.fusestatic, spec.compiler.discardvisual = False, False
    try:
        model, lost = _compiled(spec)
    except ValueError as error:
        raise AdoptionError(f"MuJoCo cannot compile {path}: {_first_line(error)}", kind) from error
    undrawn = (*undrawn, *lost)
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


def checked_sha256(path: Path, kind: Kind, stated: str | None) -> str:
    """`files_sha256`, which must be the one that is `stated`, if one is.

    Raises:
        AdoptionError: If it is another, or the file cannot be read.
    """
    found = files_sha256(path, kind)
    if stated not in (None, found):
        raise AdoptionError(
            f"{path} or a file that it names has changed since files_sha256 was written; leave the key out "
            f"to take it as it now is",
            "files_sha256",
        )
    return found


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
    """The files that an MJCF includes or attaches, and the meshes that they name, where they are there."""
    _check_mjcf(path)
    trees, named, attached = [ET.parse(path).getroot()], [], []
    for tree in trees:
        for element in tree.iter("include"):
            file = path.parent / element.get("file", "")
            if file.is_file() and file not in named:
                named.append(file)
                trees.append(ET.parse(file).getroot())
        attached += [path.parent / model.get("file", "") for model in tree.iter("model") if model.get("file")]
    compilers = [compiler for tree in trees for compiler in tree.iter("compiler")]
    folders = [path.parent / (c.get("meshdir") or c.get("assetdir") or "") for c in compilers]
    meshes = [mesh.get("file") for tree in trees for mesh in tree.iter("mesh")]
    places = (folder / mesh for folder in folders or [path.parent] for mesh in meshes if mesh)
    named += [place for place in places if place.is_file()]
    for model in attached:
        if model.is_file() and model not in named:
            named += [model, *_named_by(model)]
    return named


def _compiled(spec: mujoco.MjSpec) -> tuple[mujoco.MjModel, tuple[str, ...]]:
    """The compiled model; where that fails for meshes that are not there, without them, and their files.

    Raises:
        ValueError: If MuJoCo cannot compile it.
        AdoptionError: If a body's mass would be worked out from a mesh that is not there.
    """
    try:
        return spec.copy().compile(), ()
    except ValueError:
        undrawn = _without_lost_meshes(spec)
        if not undrawn:
            raise
    return spec.compile(), undrawn


def _without_lost_meshes(spec: mujoco.MjSpec) -> tuple[str, ...]:
    """Take meshes away whose files are not there, and what is drawn with them; their files."""
    folder = Path(spec.modelfiledir) / spec.meshdir
    files = {mesh.name: folder / mesh.file for mesh in spec.meshes if mesh.file}
    lost = {name: file for name, file in files.items() if not file.is_file()}
    for geom in list(spec.geoms):
        if geom.meshname in lost:
            body = geom.parent
            if not body.explicitinertial and body.name != "world" and geom.mass != 0.0:
                raise AdoptionError(
                    f"the mesh {lost[geom.meshname]} is not there, and the mass of body '{body.name}' comes "
                    f"from its geom",
                    "mjcf",
                )
            spec.delete(geom)
    for mesh in list(spec.meshes):
        if mesh.name in lost:
            spec.delete(mesh)
    return tuple(os.path.relpath(file, spec.modelfiledir or ".") for file in lost.values())


def _first_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return "; ".join(lines[:2]) if lines else type(error).__name__
