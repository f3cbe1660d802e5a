"""What moves as one: the bodies that hang rigidly together at each link, and their inertia."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.adopted.chain import Chain
from surgsim.models.adopted.turns import at_zero, axes_of

_WORLD = 0
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class Link:
    """A link of the arm, or its base.

    Attributes:
        bodies: Bodies of the file that it is made of, its own first.
        p_WL: Place of its frame with all joints at their zero (3,) [m].
        R_WL: Axes of its frame there (3, 3).
        mass: [kg].
        com: Centre of mass in its frame (3,) [m].
        inertia: Principal moments about the centre of mass (3,) [kg m²].
        R_LI: Their axes in its frame (3, 3).
    """

    bodies: tuple[int, ...]
    p_WL: Array
    R_WL: Array
    mass: float
    com: Array
    inertia: Array
    R_LI: Array

    def to(self, p_W: Array) -> Array:
        """A place (3,) [m], joints at their zero, in this frame."""
        return self.R_WL.T @ (p_W - self.p_WL)


@dataclass(kw_only=True, eq=False)
class Links:
    """Base and links of an arm.

    Attributes:
        base: The base.
        links: From the base on (n,).
        left_out: Bodies with joints of their own at the last link, an attached hand, and its mass [kg].
        welded: Joints beside the chain that stay at their zero.
    """

    base: Link
    links: list[Link]
    left_out: dict[str, float] = field(default_factory=dict)
    welded: list[str] = field(default_factory=list)


def rigid_links(model: mujoco.MjModel, chain: Chain) -> Links:
    """Base and links of `chain`, each with all that hangs rigidly on it.

    Joints that are not of the chain stay at their zero. What hangs on the last link with joints of its own,
    and does not carry the flange, is an attached hand: it is left out, since an instrument takes its place.
    """
    data = at_zero(model)
    children: dict[int, list[int]] = {body: [] for body in range(model.nbody)}
    for body in range(1, model.nbody):
        children[int(model.body_parentid[body])].append(body)
    hand = _hand(model, chain, children)
    left_out = {model.body(body).name: float(model.body_subtreemass[body]) for body in hand}
    stops = {*chain.links, *hand}
    groups = [
        _together(root, children, stops, alone=root == _WORLD and model.nbody > 1)
        for root in (chain.base, *chain.links)
    ]
    base, *links = (_link(model, data, group) for group in groups)
    arm = {body for group in groups for body in group}
    welded = [
        model.joint(j).name
        for j in range(model.njnt)
        if j not in chain.joints and int(model.jnt_bodyid[j]) in arm
    ]
    return Links(base=base, links=links, left_out=left_out, welded=welded)


def _hand(model: mujoco.MjModel, chain: Chain, children: dict[int, list[int]]) -> list[int]:
    """Top bodies of what hangs on the last link with joints of its own."""
    found: list[int] = []
    way = _up_to(model, chain.flange_body, chain.links[-1])
    for body in way:
        for child in children[body]:
            if child not in way and _has_joints(model, child, children):
                found.append(child)
    return found


def _up_to(model: mujoco.MjModel, body: int, top: int) -> list[int]:
    way = [body]
    while way[-1] not in (top, _WORLD):
        way.append(int(model.body_parentid[way[-1]]))
    return way


def _has_joints(model: mujoco.MjModel, body: int, children: dict[int, list[int]]) -> bool:
    return bool(model.body_jntnum[body]) or any(_has_joints(model, c, children) for c in children[body])


def _together(root: int, children: dict[int, list[int]], stops: set[int], *, alone: bool) -> tuple[int, ...]:
    """`root` and what hangs on it, short of `stops`; `alone`: only what is fixed to it itself."""
    found = [root]
    if not alone:
        for body in found:
            found.extend(child for child in children[body] if child not in stops)
    return tuple(found)


def _link(model: mujoco.MjModel, data: mujoco.MjData, bodies: tuple[int, ...]) -> Link:
    """The bodies as one: masses add up, inertias about the common centre by the parallel axes theorem."""
    own = bodies[0]
    p_WL, R_WL = data.xpos[own].copy(), data.xmat[own].reshape(3, 3).copy()
    masses = model.body_mass[list(bodies)]
    mass = float(masses.sum())
    if len(bodies) == 1 or mass == 0.0 or masses[0] == mass:  # as it is
        com, turn = model.body_ipos[own].copy(), axes_of(model.body_iquat[own])
        moments = model.body_inertia[own].copy()
        return Link(bodies=bodies, p_WL=p_WL, R_WL=R_WL, mass=mass, com=com, inertia=moments, R_LI=turn)
    com_W, inertia_W = inertia_together(model, data, bodies)
    moments, turn = principal(R_WL.T @ inertia_W @ R_WL)
    com = R_WL.T @ (com_W - p_WL)
    return Link(bodies=bodies, p_WL=p_WL, R_WL=R_WL, mass=mass, com=com, inertia=moments, R_LI=turn)


def principal(inertia: Array) -> tuple[Array, Array]:
    """Principal moments (3,) and their axes (3, 3) of an inertia (3, 3).

    A sum that breaks A + B >= C by rounding is lifted until it holds.
    """
    moments, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    lack = float(moments[2] - moments[0] - moments[1])
    if 0.0 < lack < _ROUNDING * moments[2]:
        moments[:2] += lack
    return moments, axes


def inertia_together(
    model: mujoco.MjModel, data: mujoco.MjData, bodies: Sequence[int]
) -> tuple[Array, Array]:
    """Centre of mass (3,) [m] and inertia about it (3, 3) [kg m²] of bodies as one, world frame."""
    masses = model.body_mass[list(bodies)]
    com: Array = masses @ data.xipos[list(bodies)] / masses.sum()
    inertia = np.zeros((3, 3))
    for body, mass in zip(bodies, masses, strict=True):
        turn, r = data.ximat[body].reshape(3, 3), data.xipos[body] - com
        own = turn @ np.diag(model.body_inertia[body]) @ turn.T
        inertia += own + mass * (r @ r * np.eye(3) - np.outer(r, r))
    return com, inertia
