"""What the figures show of a trace, thinned to 100 rows a second."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from surgsim.metrics.teleoperation import tip_velocity
from surgsim.studies.passive_teleoperation.measures import magnitude, speed_limited
from surgsim.trace.trace import Trace

Array = NDArray[np.float64]
Series = Mapping[str, Array]
EVERY = 10


def series(trace: Trace) -> Series:
    """Curves by name, SI units; flags and slack are the largest of each ten rows."""
    return {
        "t": _thin(trace["t_s"]),
        "tank_operator": _thin(trace["tank_operator_j"]),
        "tank_remote": _thin(trace["tank_remote_j"]),
        "slack": _largest(magnitude(trace, "slack")),
        "planes": _largest(trace["planes_active"]),
        "budget": _largest(trace["passivity_active"]),
        "scaled": _largest((trace["force_scale"] < 1.0).astype(float)),
        "speed": _largest(speed_limited(trace).astype(float)),
        "rcm": _largest(trace["rcm_error_m"]),
        "force": _thin(magnitude(trace, "tip_force")),
        "felt": _thin(magnitude(trace, "master_force")),
        "handle_speed": _thin(magnitude(trace, "handle_velocity")),
        "delivered": _thin(trace["delivered_j"]),
        "v_tip": _thin(tip_velocity(trace)[:, 0]),
        "v_command": _thin(trace.block("velocity_command")[:, 0]),
        "v_issued": _thin(trace.block("velocity_issued")[:, 0]),
    }


def _thin(values: Array) -> Array:
    return values[::EVERY].copy()


def _largest(values: Array) -> Array:
    """Largest of the rows that each kept row stands for."""
    filled = np.nan_to_num(values, nan=0.0)
    return np.maximum.reduceat(filled, np.arange(0, len(filled), EVERY))
