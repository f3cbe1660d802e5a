"""Start configuration: can the instrument follow its path through the trocar, and from which joints?"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from surgsim.array import Array
from surgsim.errors import UnreachableError
from surgsim.models.arm import ArmModel
from surgsim.models.config import InstrumentConfig, SceneConfig, TrocarConfig
from surgsim.simulate.reach import LIMIT_MARGIN_RAD, Reach, Start
from surgsim.simulate.search import roomiest
from surgsim.spatial import unit

Places = Sequence[tuple[str, Array]]

MAX_INCLINATION_RAD = np.deg2rad(80.0)
LEAST_ROOM_RAD = 0.1
"""Room to the joint limits on the whole path with which the start near a posture is taken as it is."""


def solve_start(
    arm: ArmModel,
    scene: SceneConfig,
    places: Array,
    *,
    posture: Array | None,
    home: Array,
    clear: bool,
) -> Array:
    """Start configuration (n,) [rad] of a path: tip at its first place, shaft through the trocar.

    With a posture the solution near it, if its path can be followed at least `LEAST_ROOM_RAD` away from the
    joint limits; else the one with the most room of all.

    Args:
        arm: The nominal arm.
        scene: What it is in. Without a port the path after its start is of no account near a posture.
        places: Places of the tip (k, 3) [m].
        posture: Joint positions (n,) [rad], or None.
        home: The arm's own posture (n,) [rad]: of equal solutions the nearest is taken.
        clear: Whether a start is refused from which arm and patient touch in every solution.

    Raises:
        UnreachableError: If no solution is inside the joint limits, or none is clear.
    """
    reach = Reach(arm, scene)
    near = None if posture is None else _near(reach, places, posture)
    if near is not None and near.room_rad >= LEAST_ROOM_RAD:
        return near.q
    best = _best(arm, scene, places, home if posture is None else posture, clear)
    contact = reach.contact(places, best.q) if clear and best.room_rad > -np.inf else None
    if near is not None and (near.room_rad >= best.room_rad or contact is not None):
        return near.q
    tip, rcm = reach.miss(best.q, places[0])
    if max(tip, rcm) > 1e-6:
        raise UnreachableError(
            f"the start at {_point(places[0])} cannot be reached: the best configuration found leaves the "
            f"tip {1e3 * tip:.1f} mm and the shaft {1e3 * rcm:.1f} mm away ({reach.near_limit(best.q)})"
        )
    if not reach.points_inwards(best.q):
        raise UnreachableError(
            f"the start at {_point(places[0])} cannot be reached: the shaft would point out of the patient"
        )
    if contact is not None:
        raise UnreachableError(
            f"no start is clear of contact on the whole path: with the best found {contact}"
        )
    return best.q


def _near(reach: Reach, places: Array, posture: Array) -> Start | None:
    """The solution near the posture; None if there is none, or its path cannot be followed."""
    from surgsim.simulate.posture import near_posture  # only this search needs the solver

    q = near_posture(reach, places[0], posture)
    if q is None or reach.p_WC is None:
        return None if q is None else Start(q=q, worth=np.inf, room_rad=np.inf)
    path = reach.path(places, clear=False)
    start = reach.start(path, q)
    start = replace(start, q=reach.turned_inside(path, start.q))
    return start if start.room_rad > -np.inf and reach.points_inwards(q) else None


def _best(arm: ArmModel, scene: SceneConfig, places: Array, guess: Array, clear: bool) -> Start:
    """The solution with the most room.

    Joints are free in the first search: it comes to all solutions, also by way of some past a limit. Where
    none of them leaves room, a second one keeps all joints inside, and a path may go along a limit.
    """
    best = roomiest(Reach(arm, scene, inside=False), places, guess, clear=clear)
    if best.room_rad >= LIMIT_MARGIN_RAD:
        return best
    return roomiest(Reach(arm, scene), places, guess, clear=clear)


def check_path(reach: Reach, places: Places, q_start: Array) -> None:
    """Refuse a path that the instrument cannot follow through the trocar from `q_start` (n,) [rad].

    Raises:
        UnreachableError: With the place and the reason.
    """
    points = np.array([p for _, p in places])
    followed = reach.follow(reach.path(points, clear=False), q_start)
    if followed.reached == len(places):
        return
    where, p = places[followed.reached]
    tip, rcm = reach.miss(followed.q, p)
    raise UnreachableError(
        f"{where} {_point(p)} cannot be reached: the tip stays {1e3 * tip:.1f} mm "
        f"and the shaft {1e3 * rcm:.1f} mm away ({reach.near_limit(followed.q)})"
    )


def check_through_port(
    p: Array, what: str, instrument: InstrumentConfig | None, trocar: TrocarConfig, entering: bool = False
) -> None:
    """Refuse a tip position `p` (3,) [m] that is no pose of the instrument through the port.

    `entering` allows one on the port's axis outside the patient.

    Raises:
        UnreachableError: With `what` and the reason.
    """
    if entering and _above_port(p, trocar):
        return
    reason = None if instrument is None else _outside_port(p, instrument, trocar)
    if reason:
        raise UnreachableError(f"{what} {_point(p)} cannot be reached: {reason}")


def _above_port(p: Array, trocar: TrocarConfig) -> bool:
    r, axis = p - np.array(trocar.position_m), unit(np.array(trocar.axis))
    height = float(r @ axis)
    return height >= 0.0 and float(np.linalg.norm(r - height * axis)) < 1e-3


def _outside_port(p: Array, instrument: InstrumentConfig, trocar: TrocarConfig) -> str | None:
    """Why a tip at `p` (3,) [m] is no pose through the port, or None."""
    r = p - np.array(trocar.position_m)
    away = float(np.linalg.norm(r))
    axis = unit(np.array(trocar.axis))
    beside, past = instrument.tip_from_shaft_m
    if away > 0.0 and away <= math.hypot(beside, past):
        return f"it is {away:.4f} m from the trocar: the shaft's end would be outside the patient"
    depth = math.sqrt(away * away - beside * beside) - past if beside or past else away
    if depth > instrument.shaft_length_m:
        inside = f"it is {away:.3f} m from the trocar"
        if beside or past:
            inside = f"the shaft would be {depth:.3f} m in the patient"
        return f"{inside}, but the shaft is {instrument.shaft_length_m:.3f} m long"
    if away == 0.0 or r @ axis >= 0.0:
        return f"it is outside the patient, {r @ axis:.3f} m above the port"
    turned = math.asin(beside / away)  # the tip's direction from the port is so far off the shaft's
    inclination = float(np.arccos(np.clip(-(r @ axis) / away, -1.0, 1.0))) - turned
    if inclination > MAX_INCLINATION_RAD:
        return (
            f"the shaft would be inclined {np.rad2deg(inclination):.0f} deg to the port's axis, more than "
            f"{np.rad2deg(MAX_INCLINATION_RAD):.0f} deg"
        )
    return None


def _point(p: Array) -> str:
    return "(" + ", ".join(f"{x:.3f}" for x in p) + ") m"
