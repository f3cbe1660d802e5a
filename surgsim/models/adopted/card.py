"""What was found in an arm's file, what was assumed, and what it lacks."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.adopted.capsules import Capsule
from surgsim.models.adopted.collisions import BARE_RADIUS_M
from surgsim.models.adopted.findings import Findings
from surgsim.models.adopted.form import flange_in_last_link
from surgsim.models.adopted.links import Link
from surgsim.models.adopted.problem import listed
from surgsim.models.adopted.surface import Surface

_ALIGNED = 1e-6
_HELD = 5  # degrees of freedom: the tip, and the shaft through a port


@dataclass(frozen=True, kw_only=True)
class Card:
    """An arm in a few lines.

    Attributes:
        joints: Names of the file's joints, from the base on (n,).
        links: Names of the bodies that they move (n,).
        mass_kg: Of the links, without the base.
        reach_m: From the first joint's axis to the flange, arm stretched as far as its lengths allow [m].
        rolls_shaft: Whether the last joint turns about the tool's axis.
        flange_turn_deg: Angle between the flange's z and the axis of the last joint [deg].
        redundancy: Degrees of freedom left when the tip and, through a port, the shaft are held.
        capsules: How many there are.
        sources: What is limited to where the numbers are from.
        assumed: Numbers that nobody stated.
        left_out: What of the file is not used.
        lacking: What a model of the arm would have and this file has not.
    """

    joints: tuple[str, ...]
    links: tuple[str, ...]
    mass_kg: float
    reach_m: float
    rolls_shaft: bool
    flange_turn_deg: float
    redundancy: int
    capsules: int
    sources: Mapping[str, str] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    lacking: tuple[str, ...] = ()


def card_of(
    found: Findings,
    capsules: Mapping[str, Sequence[Capsule]],
    solid: Mapping[str, Sequence[Surface]],
    joined: list[tuple[str, str]],
    remark: str | None,
) -> Card:
    """The card of an arm.

    Args:
        found: What its file holds.
        capsules: Part to where its contacts are looked for.
        solid: Part to what of it can touch.
        joined: Pairs of parts that overlap in most postures.
        remark: Something else that is left out.
    """
    model, n = found.model, found.n
    p, R = flange_in_last_link(found)
    last = found.chain.joints[-1]
    axis, anchor = model.jnt_axis[last], model.jnt_pos[last]
    off = np.linalg.norm(np.cross(R[:, 2], axis)) + np.linalg.norm(np.cross(p - anchor, axis))
    rolls = bool(off < _ALIGNED)
    return Card(
        joints=tuple(model.joint(j).name for j in found.chain.joints),
        links=tuple(model.body(b).name for b in found.chain.links),
        mass_kg=sum(link.mass for link in found.links.links),
        reach_m=_reach(found.parts, p),
        rolls_shaft=rolls,
        flange_turn_deg=float(np.rad2deg(np.arccos(np.clip(abs(R[:, 2] @ axis), 0.0, 1.0)))),
        redundancy=n - _HELD - rolls,
        capsules=sum(map(len, capsules.values())),
        sources=found.limits.sources,
        assumed=found.limits.assumed,
        left_out=(*_left_out(found, joined), *([remark] if remark else [])),
        lacking=tuple(_lacking(found, solid)),
    )


def _left_out(found: Findings, joined: list[tuple[str, str]]) -> Iterator[str]:
    model, undrawn = found.model, found.file.undrawn
    for name, mass in found.links.left_out.items():
        yield f"hand '{name}' with joints of its own, {mass:.3g} kg"
    if welded := found.links.welded:
        yield f"other joints, which stay at their zero: {listed(welded, most=4)}"
    if undrawn:
        yield f"meshes that are not there or of an unknown kind: {listed(undrawn, most=2)}"
    for one, other in joined:
        yield f"collisions of {one} with {other}, which overlap as they are drawn"
    if np.any(model.body_gravcomp):
        yield "gravity compensation of the bodies: the controller compensates gravity"
    if model.nu and np.any(model.actuator_biastype != mujoco.mjtBias.mjBIAS_NONE):
        yield "position or velocity servos: every joint has a torque motor instead"


def _lacking(found: Findings, solid: Mapping[str, Sequence[Surface]]) -> Iterator[str]:
    model, dofs = found.model, [int(found.model.jnt_dofadr[j]) for j in found.chain.joints]
    if not np.any(found.armature):
        yield (
            "inertia of the motors (armature_kg_m2): the wrist is lighter than a real one, and laws that "
            "damp each joint can be too stiff for it"
        )
    if not np.any(model.dof_damping[dofs]) and not np.any(model.dof_frictionloss[dofs]):
        yield "damping and friction of the joints"
    bare = [name for name, surfaces in solid.items() if not surfaces and found.parts[name].bodies[0]]
    if bare:
        yield f"shape of {', '.join(bare)}: a capsule of {BARE_RADIUS_M:g} m stands for it"


def _reach(parts: dict[str, Link], p_flange: Array) -> float:
    """Sum of the distances from link to link from the second joint on, and to the flange [m]."""
    places = [link.p_WL for link in parts.values()][2:]
    steps = [float(np.linalg.norm(b - a)) for a, b in pairwise(places)]
    return sum(steps) + float(np.linalg.norm(p_flange))
