"""Where contacts of an arm are looked for: capsules around its links, and pairs of them that can touch."""

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.adopted.capsules import Capsule, capsules_around, capsules_in
from surgsim.models.adopted.config import ArmFileConfig
from surgsim.models.adopted.findings import Findings
from surgsim.models.adopted.form import flange_in_last_link
from surgsim.models.adopted.limits import Limits
from surgsim.models.adopted.problem import AdoptionError
from surgsim.models.adopted.surface import Surface, hull, surface_of, thinned
from surgsim.models.adopted.touching import never_touch
from surgsim.models.adopted.turns import at_zero

BARE_RADIUS_M = 0.05
"""Of the capsule of a link that has no shape."""
ADAPTER_M, ADAPTER_RADIUS_M = 0.04, 0.026
"""Of the adapter of the shipped instrument."""
_CLOUD_M = 0.004
"""Of the points of a surface one is kept in each cube of this size."""


def surfaces_of(found: Findings) -> tuple[dict[str, list[Surface]], dict[str, list[Surface]]]:
    """What is drawn of each part, and what of it can touch.

    Drawn is what has no contacts, else all. What can touch are the meshes, drawn or not, since simple shapes
    for contacts often leave much of a link out; without a mesh what has contacts, else all.
    """
    model = found.model
    data = at_zero(model)
    drawn: dict[str, list[Surface]] = {}
    solid: dict[str, list[Surface]] = {}
    for name, link in found.parts.items():
        bodies = set(link.bodies) - {0}  # what is fixed to the world is not of the arm
        every = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] in bodies]
        hard = [geom for geom in every if model.geom_contype[geom] or model.geom_conaffinity[geom]]
        soft = [geom for geom in every if geom not in hard]
        meshes = [geom for geom in every if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH]
        for kept, geoms in ((drawn, soft or hard), (solid, meshes or hard or soft)):
            surfaces = [surface_of(model, data, geom, link.p_WL, link.R_WL) for geom in geoms]
            seen = 0.0 if kept is drawn else -1.0
            kept[name] = [s for s in surfaces if s is not None and len(s.faces) and s.rgba[3] > seen]
    return drawn, solid


def points_of(surfaces: list[Surface]) -> Array:
    """Points that stand for the surfaces (k, 3) [m], close together."""
    if not surfaces:
        return np.zeros((0, 3))
    points = np.concatenate([surface.sampled() for surface in surfaces])
    corners = [surface.points[np.unique(hull(surface.points))] for surface in surfaces]
    return np.concatenate([thinned(points, _CLOUD_M), *corners])


def find_capsules(
    found: Findings, points: dict[str, Array], robot: ArmFileConfig
) -> dict[str, list[Capsule]]:
    """Capsules of each part: listed by the scenario, stated by the file, or fitted to `points`.

    Raises:
        AdoptionError: If a listed one is of no body of the arm.
    """
    if robot.collision != "auto":
        return _listed_capsules(found, robot)
    if (stated := _stated_capsules(found)) is not None:
        return stated
    links = list(found.parts.values())
    capsules = {}
    for i, (name, link) in enumerate(found.parts.items()):
        if len(points[name]):
            capsules[name] = capsules_around(points[name])
            continue
        end = flange_in_last_link(found)[0] if link is found.last else link.to(links[i + 1].p_WL)
        capsules[name] = [Capsule(ends=np.array([np.zeros(3), end]), radius=BARE_RADIUS_M)]
    return capsules


def _stated_capsules(found: Findings) -> dict[str, list[Capsule]] | None:
    """The capsules of a file that is in the package's form already; None of another."""
    model = found.model
    stated: dict[str, list[Capsule]] = {}
    for name, link in found.parts.items():
        numeric = f"capsule_{model.body(link.bodies[0]).name}"
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, numeric) < 0:
            return None
        stated[name] = capsules_in(model.numeric(numeric).data)
    return stated


def _listed_capsules(found: Findings, robot: ArmFileConfig) -> dict[str, list[Capsule]]:
    """The capsules that the scenario lists, by the file's bodies."""
    model, parts = found.model, found.parts
    data = at_zero(model)
    capsules: dict[str, list[Capsule]] = {name: [] for name in parts}
    for i, given in enumerate(robot.listed_capsules):
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, given.body)
        part = next((name for name, link in parts.items() if body in link.bodies), None)
        if body < 0 or part is None:
            known = ", ".join(model.body(link.bodies[0]).name for link in parts.values())
            raise AdoptionError(f"'{given.body}' is no body of the arm. Known: {known}.", "collision", i)
        link, turn = parts[part], data.xmat[body].reshape(3, 3)
        ends = np.array([given.from_m, given.to_m]) @ turn.T + data.xpos[body]
        capsules[part].append(Capsule(ends=(ends - link.p_WL) @ link.R_WL, radius=given.radius_m))
    return capsules


def pairs_left_out(
    spec: mujoco.MjSpec,
    capsules: dict[str, list[Capsule]],
    points: dict[str, Array],
    limits: Limits,
    home: Array | None,
) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Parts, an instrument's adapter among them, that never or always touch."""
    spec = spec.copy()
    flange = spec.site("flange")
    flange.parent.add_body(name="adapter", pos=flange.pos, quat=flange.quat)
    bodies = {name: name for name in capsules} | {"adapter": "adapter"}
    turn = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
    ring = ADAPTER_RADIUS_M * np.stack([np.cos(turn), np.sin(turn), np.zeros(16)], axis=1)
    tube = np.concatenate([ring + np.array([0.0, 0.0, z]) for z in np.linspace(0.0, ADAPTER_M, 5)])
    ends = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, max(0.0, ADAPTER_M - ADAPTER_RADIUS_M)]])
    adapter = [Capsule(ends=ends, radius=ADAPTER_RADIUS_M)]
    return never_touch(
        spec.compile(),
        bodies,
        capsules | {"adapter": adapter},
        points | {"adapter": tube},
        limits.position,
        home,
    )
