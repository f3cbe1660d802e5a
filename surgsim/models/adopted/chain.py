"""The chain of joints from an arm's base to its flange, found in a compiled model."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.adopted.config import ArmFileConfig, FlangeConfig
from surgsim.models.adopted.problem import AdoptionError, listed
from surgsim.models.adopted.turns import axes_of
from surgsim.spatial import unit

FEWEST, MOST = 6, 8
"""Joints of an arm."""
KNOWN_FLANGES = ("flange", "attachment_site", "tool0")
"""Sites, and after them bodies, that are taken for the flange where the scenario does not say."""
_WORLD = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """Where the arm is in the model.

    Attributes:
        base: The body that its base is.
        joints: Its joints from the base on (n,).
        links: The body that each joint moves (n,).
        flange_body: The body that the flange is fixed to.
        p_LF: Flange in that body's frame (3,) [m].
        R_LF: Its axes there (3, 3); z is the tool axis.
    """

    base: int
    joints: tuple[int, ...]
    links: tuple[int, ...]
    flange_body: int
    p_LF: Array
    R_LF: Array


def find_chain(model: mujoco.MjModel, robot: ArmFileConfig) -> Chain:
    """The chain that `robot` asks for, or that is there.

    Raises:
        AdoptionError: If there is none, or it is no arm: other joints than hinges, too few, too many.
    """
    flange_body, p_LF, R_LF = _flange(model, robot.flange)
    way = _way_to(model, flange_body)
    named = _named_base(model, way, robot.base_body)
    above = way if named is None else way[way.index(named) + 1 :]
    found = [j for body in above for j in range(model.njnt) if model.jnt_bodyid[j] == body]
    joints = found if robot.joints is None else _asked(model, found, robot.joints)
    _check(model, joints)
    links = tuple(int(model.jnt_bodyid[j]) for j in joints)
    root = _WORLD if links[0] == way[1] else way[1]
    base = root if named is None else named
    return Chain(base=base, joints=tuple(joints), links=links, flange_body=flange_body, p_LF=p_LF, R_LF=R_LF)


def _flange(model: mujoco.MjModel, flange: FlangeConfig | str | None) -> tuple[int, Array, Array]:
    """Body, place and axes of the flange."""
    if flange is None:
        flange = next((name for name in KNOWN_FLANGES if _place_named(model, name) is not None), None)
    if flange is None or isinstance(flange, str):
        return _named_flange(model, flange)
    if flange.site is not None:
        return _at_site(model, _id(model, "site", flange.site, "flange", "site"))
    body = _id(model, "body", flange.body or "", "flange", "body")
    return body, np.array(flange.position_m), axes_of(unit(np.array(flange.quaternion_wxyz)))


def _place_named(model: mujoco.MjModel, name: str) -> tuple[int, Array, Array] | None:
    """Body, place and axes of the site, else the body, of that name."""
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name)
    if site >= 0:
        return _at_site(model, site)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    return (body, np.zeros(3), np.eye(3)) if body > _WORLD else None


def _named_flange(model: mujoco.MjModel, name: str | None) -> tuple[int, Array, Array]:
    place = None if name is None else _place_named(model, name)
    if place is not None:
        return place
    last = [body for body in range(1, model.nbody) if not np.any(model.body_parentid[1:] == body)]
    lack = (
        f"the file does not say where its flange is: there is no site or body named "
        f"{' or '.join(KNOWN_FLANGES)}; name one as flange"
        if name is None
        else f"the file has no site or body '{name}'"
    )
    raise AdoptionError(
        f"{lack}. Sites: {listed(model.site(i).name for i in range(model.nsite))}. Last bodies: "
        f"{listed(model.body(i).name for i in last)}.",
        "flange",
    )


def _at_site(model: mujoco.MjModel, site: int) -> tuple[int, Array, Array]:
    return int(model.site_bodyid[site]), model.site_pos[site].copy(), axes_of(model.site_quat[site])


def _way_to(model: mujoco.MjModel, body: int) -> list[int]:
    """Bodies from the world to `body`."""
    way = [body]
    while way[-1] != _WORLD:
        way.append(int(model.body_parentid[way[-1]]))
    return way[::-1]


def _named_base(model: mujoco.MjModel, way: list[int], name: str | None) -> int | None:
    """The body that is named as the base; None if none is.

    Raises:
        AdoptionError: If it is not on the way, or no joint is.
    """
    if name is not None:
        base = _id(model, "body", name, "base_body")
        if base not in way:
            raise AdoptionError(f"body '{name}' is not on the way from the root to the flange", "base_body")
        return base
    if not any(model.body_jntnum[body] for body in way):
        raise AdoptionError(
            f"no joint moves the flange, on body '{model.body(way[-1]).name}'. Joints: "
            f"{listed(model.joint(i).name for i in range(model.njnt))}.",
            "flange",
        )
    return None


def _asked(model: mujoco.MjModel, found: list[int], names: Sequence[str]) -> list[int]:
    joints = [_id(model, "joint", name, "joints", i) for i, name in enumerate(names)]
    for i, joint in enumerate(joints):
        if joint not in found:
            raise AdoptionError(
                f"joint '{names[i]}' is not between base and flange. There are: "
                f"{listed(model.joint(j).name for j in found)}.",
                "joints",
                i,
            )
    if joints != sorted(set(joints), key=found.index):
        in_order = listed(model.joint(j).name for j in sorted(set(joints), key=found.index))
        raise AdoptionError(f"the joints must stand once each, from the base on: {in_order}", "joints")
    return joints


def _check(model: mujoco.MjModel, joints: Sequence[int]) -> None:
    names = [model.joint(j).name or f"number {j}" for j in joints]
    for joint, name in zip(joints, names, strict=True):
        kind = mujoco.mjtJoint(model.jnt_type[joint])
        if kind != mujoco.mjtJoint.mjJNT_HINGE:
            what = kind.name.removeprefix("mjJNT_").lower()
            raise AdoptionError(
                f"joint '{name}' is a {what} joint: an arm has hinges alone. List the arm's joints as "
                f"joints; others stay where they are",
                "joints",
            )
        dof = model.jnt_dofadr[joint]
        if np.any(model.dof_dampingpoly[dof]):
            raise AdoptionError(f"joint '{name}' has damping that is not linear: not supported", "joints")
        if np.any(model.jnt_stiffness[joint]) or np.any(model.jnt_stiffnesspoly[joint]):
            raise AdoptionError(
                f"joint '{name}' has a spring ({float(np.ravel(model.jnt_stiffness[joint])[0]):g} N m/rad): "
                f"arms with springs are not supported",
                "joints",
            )
    if not FEWEST <= len(joints) <= MOST:
        few = "none" if not joints else f"{len(joints)}: {listed(names)}"
        raise AdoptionError(
            f"an arm has {FEWEST} to {MOST} joints; between base and flange there are {few}", "joints"
        )
    links = [int(model.jnt_bodyid[j]) for j in joints]
    for i, link in enumerate(links[1:], start=1):
        if link == links[i - 1]:
            raise AdoptionError(
                f"joints '{names[i - 1]}' and '{names[i]}' both move body '{model.body(link).name}': give "
                f"each a body of its own",
                "joints",
            )
    _check_couplings(model, joints, names)


def _check_couplings(model: mujoco.MjModel, joints: Sequence[int], names: Sequence[str]) -> None:
    """Refuse equalities and tendons that couple the arm's joints: the form of an arm has none."""
    for joint, name in zip(joints, names, strict=True):
        for i in range(model.neq):
            on_joint = model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT
            if on_joint and joint in (model.eq_obj1id[i], model.eq_obj2id[i]):
                raise AdoptionError(f"joint '{name}' is coupled by an equality: not supported", "joints")
        wraps = model.wrap_objid[model.wrap_type == mujoco.mjtWrap.mjWRAP_JOINT]
        if joint in wraps:
            raise AdoptionError(f"joint '{name}' is driven by a tendon: not supported", "joints")


def _id(model: mujoco.MjModel, kind: str, name: str, *at: str | int) -> int:
    """Id of the part `name`.

    Raises:
        AdoptionError: If there is none.
    """
    objects = {
        "site": (mujoco.mjtObj.mjOBJ_SITE, model.nsite, "Sites"),
        "body": (mujoco.mjtObj.mjOBJ_BODY, model.nbody, "Bodies"),
        "joint": (mujoco.mjtObj.mjOBJ_JOINT, model.njnt, "Joints"),
    }
    number, count, plural = objects[kind]
    found = int(mujoco.mj_name2id(model, number, name))
    if found < 0:
        known = listed((mujoco.mj_id2name(model, number, i) or "" for i in range(count)), most=20)
        raise AdoptionError(f"the file has no {kind} '{name}'. {plural}: {known}.", *at)
    return found
