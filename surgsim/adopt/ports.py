"""Where a port can be for an arm: a section through its workspace."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from surgsim.array import Array
from surgsim.errors import SurgsimError
from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig
from surgsim.scenario.load import load_scenario
from surgsim.scenario.schema import Scenario
from surgsim.simulate.setup import beginning

RADIUS_M, DEPTH_M = 0.02, 0.15
"""Of the circle that is followed through each port."""
_ACROSS, _UP = 9, 8
_LOWEST_M = -0.2


@dataclass(frozen=True, kw_only=True, eq=False)
class PortMap:
    """Ports in front of the base, upright, and the room that a circle through each leaves.

    Attributes:
        x_m: Distances from the base along its x axis (k,) [m].
        z_m: Heights above the base (l,) [m].
        margin_rad: Smallest distance of a joint from its limit at the start (l, k) [rad]; NaN where the
            circle cannot be followed.
        reasons: Why not, for the places where it cannot, each with how often.
    """

    x_m: Array
    z_m: Array
    margin_rad: Array
    reasons: dict[str, int]

    @property
    def reached(self) -> int:
        """How many of the places can be reached."""
        return int(np.isfinite(self.margin_rad).sum())

    @property
    def best_m(self) -> tuple[float, float] | None:
        """Distance and height of the place with the most room [m]; None if none can be reached."""
        if not self.reached:
            return None
        row, column = np.unravel_index(np.nanargmax(self.margin_rad), self.margin_rad.shape)
        return float(self.x_m[column]), float(self.z_m[row])


def map_ports(
    robot: RobotConfig, reach_m: float, progress: Callable[[int, int], None] | None = None
) -> PortMap:
    """Try upright ports in front of the base.

    Args:
        robot: The arm.
        reach_m: How far it reaches.
        progress: Told how many places were tried, and of how many.
    """
    x_m = np.linspace(0.2, max(0.5, 0.95 * reach_m), _ACROSS)
    z_m = np.linspace(_LOWEST_M, max(0.2, 0.6 * reach_m), _UP)
    margin = np.full((_UP, _ACROSS), np.nan)
    reasons: dict[str, int] = {}
    for i in range(_UP * _ACROSS):
        row, column = divmod(i, _ACROSS)
        try:
            margin[row, column] = _margin(circle_through(robot, (x_m[column], 0.0, z_m[row])))
        except SurgsimError as error:
            reason = _kind(str(error))
            reasons[reason] = reasons.get(reason, 0) + 1
        if progress is not None:
            progress(i + 1, _UP * _ACROSS)
    return PortMap(x_m=x_m, z_m=z_m, margin_rad=margin, reasons=reasons)


def circle_through(
    robot: RobotConfig, port_m: tuple[float, float, float], duration_s: float = 3.0
) -> Scenario:
    """A circle below an upright port, under the inverse dynamics that holds the port."""
    x, y, z = (float(value) for value in port_m)
    content: dict[str, Any] = {
        "name": "adopted_circle",
        "robot": robot,
        "trocar": {"position_m": [x, y, z]},
        "theatre": False,
        "task": {
            "type": "circle",
            "radius_m": RADIUS_M,
            "start_m": [x + RADIUS_M, y, z - DEPTH_M],
            "duration_s": duration_s,
        },
        "controller": "rcm_inverse_dynamics",
    }
    return load_scenario(content)


def _margin(scenario: Scenario) -> float:
    """Smallest distance of a joint from its limit at the start [rad].

    Raises:
        SurgsimError: If the circle cannot be followed.
    """
    arm = ArmModel(scenario.scene)
    q, _ = beginning(scenario, arm)
    return float(np.minimum(q - arm.limits.q_min, arm.limits.q_max - q).min())


def _kind(text: str) -> str:
    """What in a refusal says why, without its place and its depth."""
    if "contact" in text or "touch" in text:
        return "the arm would touch itself or the patient"
    return text[text.rfind("(") + 1 :].rstrip(")") if "(" in text else text.partition(": ")[2] or text
