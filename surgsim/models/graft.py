"""Put one MJCF model into another without changing what its parts are called."""

import mujoco

from surgsim.resources import resource_dir


def asset(path: str) -> mujoco.MjSpec:
    """The MJCF file `path` under `assets/`."""
    return mujoco.MjSpec.from_file(str(resource_dir("assets") / path))


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
