"""An instrument from somebody's file, in the form that the package's own instrument has.

The file's first body is fixed to the flange. Two sites say where the shaft is: it is straight from the one to
the other, and the remote centre of motion is held on that line. A third one is the tip; where the file has no
site of the shaft's end, the shaft ends there.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.adopted.file import read_file
from surgsim.models.adopted.form import draw, set_inertia
from surgsim.models.adopted.links import inertia_together, principal
from surgsim.models.adopted.problem import AdoptionError, listed
from surgsim.models.adopted.surface import Surface, coarser, surface_of
from surgsim.models.adopted.turns import at_zero, quaternion_of

SHAFT_END = "shaft_end"
"""Site at the end of the shaft of an instrument whose tip is not there."""
_LEAST_SHAFT_M, _MOST_SHAFT_M = 0.05, 1.0
_MOST_BENT_M = 0.1
"""Farthest that the tip may be from the shaft's end."""
_STRAIGHT_M = 1e-9
_MOST_TURN_RAD = np.deg2rad(1.0)
_MOST_DRAWN = 6000
"""Triangles of a drawn mesh."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ToolCamera:
    """A camera of an instrument, as MuJoCo's: it looks along its -z, its y is up.

    Attributes:
        name: Its name in the file.
        position: In the instrument's frame (3,) [m].
        R: Its axes there (3, 3).
        fovy_deg: Its field of view, from top to bottom [deg].
    """

    name: str
    position: Array
    R: Array
    fovy_deg: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Tool:
    """An instrument from a file. Its frame has z along the shaft, towards the tip.

    Attributes:
        p_ET: Origin of its frame in that of the flange (3,) [m]: the shaft's line nearest to the flange.
        R_ET: Axes of its frame there (3, 3).
        adapter_length_m: From its origin to the start of the shaft.
        shaft_length_m: From there to the shaft's end.
        p_ST: The tip from the shaft's end in its frame (3,) [m]; zeros where the shaft ends at the tip.
        mass: [kg].
        com: Centre of mass in its frame (3,) [m].
        inertia: Principal moments about the centre of mass (3,) [kg m²].
        R_TI: Their axes in its frame (3, 3).
        surfaces: What is drawn.
        cameras: What it sees with.
    """

    p_ET: Array
    R_ET: Array
    adapter_length_m: float
    shaft_length_m: float
    p_ST: Array
    mass: float
    com: Array
    inertia: Array
    R_TI: Array
    surfaces: tuple[Surface, ...]
    cameras: tuple[ToolCamera, ...] = ()


@lru_cache(maxsize=16)
def read_tool(path: Path, entry_site: str, end_site: str, tip_site: str, files_sha256: str) -> Tool:
    """The instrument in the MJCF file at `path`; its joints, of jaws for instance, stay at their zero.

    Args:
        path: The file.
        entry_site: Site at the start of the shaft.
        end_site: Site at its end; where the file has none of the name `SHAFT_END`, the shaft ends at the tip.
        tip_site: Site at the tip.
        files_sha256: Hash of the file, so that another content is read again.

    Raises:
        AdoptionError: If it is no instrument.
    """
    del files_sha256
    model = read_file(path, "mjcf").model
    data = at_zero(model)
    mujoco.mj_camlight(model, data)
    if model.nbody < 2:
        raise AdoptionError(f"{path} has no body", "mjcf")
    root = 1
    bodies = [body for body in range(1, model.nbody) if model.body_rootid[body] == root]
    entry, tip = (
        data.site_xpos[_site(model, bodies, name, key)]
        for name, key in ((entry_site, "shaft_entry_site"), (tip_site, "tip_site"))
    )
    is_bent = end_site != SHAFT_END or mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, end_site) >= 0
    end_name, end_key = (end_site, "shaft_end_site") if is_bent else (tip_site, "tip_site")
    end_id = _site(model, bodies, end_name, end_key)
    end = data.site_xpos[end_id]
    length = float(np.linalg.norm(end - entry))
    if not _LEAST_SHAFT_M <= length <= _MOST_SHAFT_M:
        raise AdoptionError(
            f"the shaft from site '{entry_site}' to site '{end_name}' is {length:.3f} m long; it must be "
            f"{_LEAST_SHAFT_M:g} to {_MOST_SHAFT_M:g} m",
            end_key,
        )
    if not model.body_mass[bodies].sum() > 0.0:
        raise AdoptionError(f"{path} has no mass", "mjcf")
    axis, p_WE, R_WE = (end - entry) / length, data.xpos[root], data.xmat[root].reshape(3, 3)
    adapter = max(0.0, float((entry - p_WE) @ axis))
    origin, R_WT = entry - adapter * axis, _axes(axis, R_WE)
    p_ST = R_WT.T @ (tip - end)
    if is_bent:
        _check_end(end_site, data.site_xmat[end_id].reshape(3, 3)[:, 2], axis)
        _check_bent(tip_site, end_site, p_ST)
    com, inertia = inertia_together(model, data, bodies)
    moments, turn = principal(R_WT.T @ inertia @ R_WT)
    geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] in bodies and model.geom_rgba[g][3] > 0.0]
    surfaces = (surface_of(model, data, geom, origin, R_WT) for geom in geoms)
    return Tool(
        p_ET=R_WE.T @ (origin - p_WE),
        R_ET=R_WE.T @ R_WT,
        adapter_length_m=adapter,
        shaft_length_m=length,
        p_ST=p_ST if np.linalg.norm(p_ST) > _STRAIGHT_M else np.zeros(3),
        mass=float(model.body_mass[bodies].sum()),
        com=R_WT.T @ (com - origin),
        inertia=moments,
        R_TI=turn,
        surfaces=tuple(s for s in surfaces if s is not None and len(s.faces)),
        cameras=tuple(
            ToolCamera(
                name=str(model.cam(i).name) or f"camera{i}",
                position=R_WT.T @ (data.cam_xpos[i] - origin),
                R=R_WT.T @ data.cam_xmat[i].reshape(3, 3),
                fovy_deg=float(model.cam_fovy[i]),
            )
            for i in range(model.ncam)
            if model.cam_bodyid[i] in bodies
        ),
    )


def _check_end(name: str, z: Array, axis: Array) -> None:
    """Refuse a shaft's end whose z is not along the shaft: such as one that was put at a bent tip."""
    turn = float(np.arccos(np.clip(z @ axis, -1.0, 1.0)))
    if turn > _MOST_TURN_RAD:
        raise AdoptionError(
            f"site '{name}' has its z {np.rad2deg(turn):.1f} deg off the shaft; it must be along it, from "
            "the entry on",
            "shaft_end_site",
        )


def _check_bent(tip: str, end: str, p_ST: Array) -> None:
    """Refuse a tip that could not go through a port behind the shaft's end."""
    if p_ST[2] < -_STRAIGHT_M:
        raise AdoptionError(
            f"the tip, site '{tip}', is {-1e3 * p_ST[2]:.1f} mm behind the shaft's end, site '{end}': it "
            "would touch the port when inserted; it must be beside the end or past it",
            "tip_site",
        )
    off = float(np.linalg.norm(p_ST))
    if off > _MOST_BENT_M:
        raise AdoptionError(
            f"the tip, site '{tip}', is {off:.3f} m from the shaft's end, site '{end}'; it must be at most "
            f"{_MOST_BENT_M:g} m",
            "tip_site",
        )


def _axes(z: Array, like: Array) -> Array:
    """Axes (3, 3) whose third is `z`, turned from those of `like` no more than needed."""
    x = like[:, 0] - (like[:, 0] @ z) * z
    if np.linalg.norm(x) < 1e-6:
        x = like[:, 1] - (like[:, 1] @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _site(model: mujoco.MjModel, bodies: list[int], name: str, key: str) -> int:
    """Id of a site on one of `bodies`."""
    found = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name))
    if found < 0 or model.site_bodyid[found] not in bodies:
        known = listed(model.site(i).name for i in range(model.nsite) if model.site_bodyid[i] in bodies)
        raise AdoptionError(f"the instrument has no site '{name}'. Sites: {known}.", key)
    return found


def tool_spec(tool: Tool) -> mujoco.MjSpec:
    """The instrument alone, its flange at the origin: `instrument` with `shaft_entry`, `tip` and `jaws`.

    Where the tip is not the shaft's end it has the site `SHAFT_END`, too. All sites have z along the shaft.
    """
    spec = mujoco.MjSpec()
    spec.modelname = "instrument_from_file"
    spec.compiler.degree = False
    spec.compiler.balanceinertia = False
    body = spec.worldbody.add_body(name="instrument", pos=tool.p_ET, quat=quaternion_of(tool.R_ET))
    set_inertia(body, tool.mass, tool.com, tool.inertia, tool.R_TI)
    entry, end = tool.adapter_length_m, tool.adapter_length_m + tool.shaft_length_m
    tip = np.array([0.0, 0.0, end]) + tool.p_ST
    body.add_site(name="shaft_entry", pos=[0.0, 0.0, entry], group=4)
    if tool.p_ST.any():
        body.add_site(name=SHAFT_END, pos=[0.0, 0.0, end], group=4)
    body.add_site(name="tip", pos=tip, group=4)
    body.add_body(name="jaws", pos=tip)
    for camera in tool.cameras:
        turn = quaternion_of(camera.R)
        body.add_camera(name=camera.name, pos=camera.position, quat=turn, fovy=camera.fovy_deg)
    for i, surface in enumerate(tool.surfaces):
        draw(spec, "instrument", f"instrument_{i}", coarser(surface, _MOST_DRAWN))
    return spec
