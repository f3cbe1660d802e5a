"""Put one MJCF model into another without changing what its parts are called."""

import os
from functools import lru_cache
from pathlib import Path

import mujoco

from surgsim.resources import resource_dir


def asset(path: str, *, drawn: bool = True) -> mujoco.MjSpec:
    """The MJCF file `path` under `assets/`, to be changed; unless `drawn` without what is only looked at."""
    return read_mjcf(resource_dir("assets") / path, drawn=drawn)


def read_mjcf(file: Path, *, drawn: bool = True) -> mujoco.MjSpec:
    """The MJCF `file`, to be changed; unless `drawn` without what is only looked at.

    MuJoCo can discard that itself, but computes its meshes first, which takes longer than all the rest.

    Raises:
        ValueError: If MuJoCo cannot read it.
    """
    return _read(str(file), drawn, os.stat(file).st_mtime_ns).copy()


@lru_cache(maxsize=32)
def _read(file: str, drawn: bool, changed_ns: int) -> mujoco.MjSpec:
    """The file as it was when it was changed last."""
    del changed_ns  # of the key alone
    spec = mujoco.MjSpec.from_file(file)
    if not drawn:
        for geom in list(spec.geoms):
            if not (geom.contype or geom.conaffinity):
                spec.delete(geom)
        used = {geom.meshname for geom in spec.geoms}
        for mesh in list(spec.meshes):
            if mesh.name not in used:
                spec.delete(mesh)
    return spec


def graft(
    parent: mujoco.MjSpec,
    child: mujoco.MjSpec,
    *,
    frame: mujoco.MjsFrame | None = None,
    site: mujoco.MjsSite | None = None,
) -> None:
    """Attach `child` to `parent` at a frame or site, its parts keeping their names.

    MuJoCo refuses to save a model that was attached with an empty prefix. So the child's model name is the
    prefix, and is taken off again wherever a name is part of surgsim's interface; materials, meshes and
    classes keep it, and cannot clash.
    """
    prefix = f"{child.modelname}/"
    where = {"frame": frame} if site is None else {"site": site}
    parent.attach(child, prefix=prefix, **where)
    for kind in ("bodies", "joints", "geoms", "sites", "cameras", "lights", "numerics", "actuators"):
        for part in getattr(parent, kind):
            part.name = part.name.removeprefix(prefix)
    for motor in parent.actuators:
        motor.target = motor.target.removeprefix(prefix)
