"""Board, pegs and rings as MuJoCo bodies.

A ring is a free body of capsules along its rim, which touch pegs, jaws and other rings, and of spheres inside
them, its feet, which touch the board: with the capsules a ring that lies flat would have four times as many
contacts.
"""

import itertools
import math

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.peg_board import PegBoardLayout
from surgsim.plant.props.base import TIP_CONTACT_BIT, contact_tip

RIM_BIT = 4
"""Rims touch rims and pegs."""
FOOT_BIT = 8
"""Feet touch board and floor."""
SEGMENTS = 12
FEET = 6
_THICKNESS_M = 0.006
_MARGIN_M = 0.02
_SOLID = {
    "condim": 3,
    "friction": [0.5, 0.0, 0.0],
    "solref": [0.004, 1.0],
    "solimp": [0.95, 0.99, 0.0005, 0.5, 2.0],
    "priority": 1,
}
_COLOURS = ((0.84, 0.15, 0.16), (0.95, 0.75, 0.10), (0.12, 0.42, 0.75), (0.20, 0.60, 0.30))
_BOARD_RGBA = [0.93, 0.93, 0.90, 1.0]
_PEG_RGBA = ([0.55, 0.57, 0.60, 1.0], [0.10, 0.55, 0.55, 1.0])


def ring_name(ring: int) -> str:
    """Name of body and joint of a ring, counted from 0."""
    return f"ring{ring + 1}"


def hold_name(ring: int) -> str:
    """Name of the constraint that holds a ring in the jaws, and of the sensor of its force."""
    return f"{ring_name(ring)}_hold"


def add_board(spec: mujoco.MjSpec, layout: PegBoardLayout) -> None:
    """The board with its pegs, and an endless floor under it that catches what falls off."""
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, layout.R_WB.ravel())
    board = spec.worldbody.add_body(name="peg_board", pos=layout.position_m, quat=quat)
    pegs = np.array([*layout.source_m, *layout.target_m])
    low, high = pegs.min(axis=0) - _MARGIN_M, pegs.max(axis=0) + _MARGIN_M
    board.add_geom(
        name="peg_board",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[*(high - low) / 2, _THICKNESS_M / 2],
        pos=[*(high + low) / 2, -_THICKNESS_M / 2],
        contype=0,
        conaffinity=TIP_CONTACT_BIT | FOOT_BIT,
        rgba=_BOARD_RGBA,
        **_SOLID,
    )
    board.add_geom(
        name="peg_board_floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[1.0, 1.0, 1.0],
        pos=[0.0, 0.0, -_THICKNESS_M],
        contype=0,
        conaffinity=FOOT_BIT,
        group=3,
        **_SOLID,
    )
    for i, (x, y) in enumerate(pegs):
        board.add_geom(
            name=f"peg{i + 1}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[x, y, -_THICKNESS_M / 2, x, y, layout.peg_height_m - layout.peg_radius_m],
            size=[layout.peg_radius_m, 0, 0],
            contype=0,
            conaffinity=TIP_CONTACT_BIT | RIM_BIT,
            rgba=_PEG_RGBA[i >= len(layout.source_m)],
            **_SOLID,
        )


def add_rings(spec: mujoco.MjSpec, layout: PegBoardLayout) -> None:
    """The rings, each round its source peg."""
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, layout.R_WB.ravel())
    for ring, (x, y) in enumerate(layout.source_m):
        body = spec.worldbody.add_body(
            name=ring_name(ring),
            pos=layout.point(x, y, layout.rim_radius_m),
            quat=quat,
            mass=layout.ring_mass_kg,
            inertia=_inertia(layout),
            ipos=[0.0, 0.0, 0.0],
            explicitinertial=True,
        )
        body.add_freejoint(name=ring_name(ring))
        _add_rim(body, layout, [*_COLOURS[ring % len(_COLOURS)], 1.0])
        _add_feet(body, layout)


def add_holds(spec: mujoco.MjSpec, layout: PegBoardLayout) -> None:
    """For each ring a weld to the jaws, not active, with a sensor of its force; one of all force on the jaws.

    The weld acts on a massless body of its own on the ring, so that the force between the two is the weld's.
    """
    contact_tip(spec)
    spec.body("jaws").add_site(name="jaws_load", group=4)
    _add_force_sensor(spec, "jaws_load")
    for ring in range(len(layout.source_m)):
        hold = hold_name(ring)
        spec.body(ring_name(ring)).add_body(name=hold).add_site(name=hold, group=4)
        spec.add_equality(
            name=hold,
            type=mujoco.mjtEq.mjEQ_WELD,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            name1="jaws",
            name2=hold,
            active=False,
            solref=_SOLID["solref"],
            solimp=_SOLID["solimp"],
        )
        _add_force_sensor(spec, hold)


def _add_force_sensor(spec: mujoco.MjSpec, site: str) -> None:
    spec.add_sensor(
        name=site, type=mujoco.mjtSensor.mjSENS_FORCE, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site
    )


def _add_rim(body: mujoco.MjsBody, layout: PegBoardLayout, rgba: list[float]) -> None:
    """Capsules along a polygon round the rim's middle circle: the hole is nowhere narrower than said."""
    corners = _circle(SEGMENTS, layout.ring_radius_m / math.cos(math.pi / SEGMENTS))
    for a, b in itertools.pairwise([*corners, corners[0]]):
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[*a, *b],
            size=[layout.rim_radius_m, 0, 0],
            contype=RIM_BIT,
            conaffinity=RIM_BIT | TIP_CONTACT_BIT,
            rgba=rgba,
            **_SOLID,
        )


def _add_feet(body: mujoco.MjsBody, layout: PegBoardLayout) -> None:
    for place in _circle(FEET, layout.ring_radius_m):
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[layout.rim_radius_m, 0, 0],
            pos=place,
            contype=FOOT_BIT,
            conaffinity=0,
            group=3,
            **_SOLID,
        )


def _circle(count: int, radius: float) -> Array:
    """Points (count, 3) on a circle about the z axis."""
    angle = 2 * np.pi * np.arange(count) / count
    return radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])


def _inertia(layout: PegBoardLayout) -> Array:
    """Principal inertia (3,) [kg m²] of a torus: m (4R² + 5r²)/8 across, m (4R² + 3r²)/4 about its axis."""
    m, R, r = layout.ring_mass_kg, layout.ring_radius_m, layout.rim_radius_m
    across = m * (4 * R**2 + 5 * r**2) / 8
    return np.array([across, across, m * (4 * R**2 + 3 * r**2) / 4])
