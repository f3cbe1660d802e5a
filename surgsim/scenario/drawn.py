"""Scenarios that are drawn: `random_<robot>_<seed>`, a port somewhere around the arm and a path through it.

Every value is drawn by its own name, from a hash of seed and name: the same on every machine and with every
version of every library, and one that is added later changes none of the others.
"""

import hashlib
import math
import re
from collections.abc import Sequence
from typing import Any

from surgsim.errors import ScenarioError, unknown_name
from surgsim.models.folders import known_robot, robot_names
from surgsim.scenario.plain import document_of
from surgsim.scenario.yaml_text import YamlDocument

_NAME = re.compile(r"random_([a-z0-9_]*?[a-z0-9])(?:_([0-9]{1,9}))?")
_CONTROLLER = "rcm_inverse_dynamics"
_LARGEST_TILT_DEG = 25.0


def drawn_names() -> dict[str, str]:
    """Names of the drawn scenarios, without a seed, with a line about each."""
    return {f"random_{robot}": _description(robot) for robot in robot_names()}


def drawn_document(name: str, seed: int | None) -> YamlDocument | None:
    """The scenario that `name` and `seed` draw; None if it is no name of a drawn one.

    Args:
        name: `random_panda_17`, or `random_panda`, whose seed is `seed`, or 0.
        seed: Seed that was asked for, or None.

    Raises:
        ScenarioError: If there is no such robot, or the name says another seed.
    """
    match = _NAME.fullmatch(name)
    if match is None:
        return None
    robot, number = _robot_and_seed(match)
    try:
        known_robot(robot)
    except ValueError as error:
        raise ScenarioError("", f"{unknown_name(name, 'drawn scenario', drawn_names())}") from error
    if number is not None and seed not in (None, number):
        raise ScenarioError("--seed", f"{seed} is another than that of '{name}'; leave one of them out")
    drawn = number if number is not None else seed or 0
    return document_of(_content(robot, drawn), f"random_{robot}_{drawn}")


def _robot_and_seed(match: re.Match[str]) -> tuple[str, int | None]:
    """The robot's own name may end in a number."""
    whole = match[1] if match[2] is None else f"{match[1]}_{match[2]}"
    try:
        return known_robot(whole), None
    except ValueError:
        return match[1], None if match[2] is None else int(match[2])


def _description(robot: str) -> str:
    return f"{robot} follows a path through a port, both drawn by the seed, with a load it does not know"


class _Draw:
    """Values of a seed, each by its name."""

    def __init__(self, seed: int) -> None:
        self._seed = seed

    def between(self, name: str, low: float, high: float, digits: int) -> float:
        """A value from `low` to `high`, rounded."""
        text = f"surgsim drawn scenario 1 {self._seed} {name}"
        share = int.from_bytes(hashlib.sha256(text.encode()).digest()[:6], "big") / 2.0**48
        return round(low + share * (high - low), digits)

    def one_of(self, name: str, of: Sequence[str]) -> str:
        """One of several."""
        return of[int(self.between(name, 0.0, len(of) - 1e-9, 12))]


def _content(robot: str, seed: int) -> dict[str, Any]:
    draw = _Draw(seed)
    turn, out = draw.between("port.turn_deg", -180.0, 180.0, 1), draw.between("port.out_m", 0.33, 0.64, 4)
    up = draw.between("port.up_m", 0.05, 0.39, 4)
    side = draw.between("port.side_deg", -180.0, 180.0, 1)
    axis = _direction(draw.between("port.tilt_deg", 0.0, _LARGEST_TILT_DEG, 1), side)
    flat = _direction(90.0, turn)
    position = [round(out * flat[0], 4), round(out * flat[1], 4), up]
    depth = draw.between("depth_m", 0.07, 0.20, 4)
    return {
        "name": f"random_{robot}",
        "description": _description(robot),
        "seed": seed,
        "robot": {"name": robot},
        "trocar": {"position_m": position, "axis": axis},
        "task": {
            **_shape(draw),
            "start_m": [round(p - depth * a, 4) for p, a in zip(position, axis, strict=True)],
            "normal": axis,
            "direction": _direction(90.0, draw.between("path.turn_deg", -180.0, 180.0, 1)),
            "duration_s": draw.between("path.duration_s", 2.5, 5.0, 2),
            "hold_start_s": 0.2,
            "hold_end_s": 0.2,
        },
        "controller": _CONTROLLER,
        "disturbances": [
            {"type": "payload", "mass_kg": draw.between("payload_kg", 0.05, 0.3, 3)},
            {"type": "joint_friction", "coulomb_nm": draw.between("friction_nm", 0.1, 0.8, 3)},
            {"type": "inertia_error", "factor": draw.between("inertia", 0.9, 1.15, 3)},
        ],
    }


def _shape(draw: _Draw) -> dict[str, Any]:
    """One of three kinds of path, across the port's axis; a spiral also goes 2 cm outwards along it."""
    kind = draw.one_of("path", ("circle", "sinusoid", "spiral"))
    radius = draw.between("path.radius_m", 0.005, 0.02, 4)
    if kind == "circle":
        return {"type": kind, "radius_m": radius}
    if kind == "sinusoid":
        length = draw.between("path.length_m", 0.02, 0.06, 4)
        return {"type": kind, "amplitude_m": round(0.5 * radius, 4), "length_m": length, "periods": 1.5}
    return {"type": kind, "radius_m": round(0.6 * radius, 4), "length_m": 0.02, "turns": 2.0}


def _direction(tilt_deg: float, turn_deg: float) -> list[float]:
    """Unit vector (3,), so far from the vertical and turned about it."""
    tilt, turn = math.radians(tilt_deg), math.radians(turn_deg)
    exact = math.sin(tilt) * math.cos(turn), math.sin(tilt) * math.sin(turn), math.cos(tilt)
    return [round(x, 6) for x in exact]
