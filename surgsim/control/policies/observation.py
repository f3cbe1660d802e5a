"""What a policy sees at a tick: the same as any other controller, as named arrays."""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from surgsim.control.rcm import Rcm
from surgsim.models.arm import Kinematics
from surgsim.tasks.base import TipCommand

Array = NDArray[np.float64]
Observation = Mapping[str, Array]


class Seen(Protocol):
    """A velocity problem, a torque problem, or anything else with a state and the command for it."""

    @property
    def t_s(self) -> float:
        """Time since the start [s]."""

    @property
    def q(self) -> Array:
        """Joint positions (n,) [rad]."""

    @property
    def v(self) -> Array:
        """Joint velocities (n,) [rad/s]."""

    @property
    def kin(self) -> Kinematics:
        """Nominal kinematics at `q`."""

    @property
    def command(self) -> TipCommand:
        """The task's command."""

    @property
    def rcm(self) -> Rcm | None:
        """RCM error, or None without a trocar."""

    @property
    def p_WC(self) -> Array:
        """Trocar position (3,) [m]."""

    @property
    def v_WC(self) -> Array:
        """Trocar velocity (3,) [m/s]."""


def observe(seen: Seen) -> dict[str, Array]:
    """The observation, in order; the last four are absent without a trocar.

    | name | shape | meaning |
    |---|---|---|
    | `time` | (1,) | time since the start [s] |
    | `joint_position` | (n,) | q [rad] |
    | `joint_velocity` | (n,) | q' [rad/s] |
    | `tip_position` | (3,) | p_WT [m] |
    | `tip_error` | (3,) | p_WT - p_WTd, to the command now [m] |
    | `command_velocity` | (3,) | v_WTd [m/s] |
    | `command_acceleration` | (3,) | a_WTd [m/s^2] |
    | `rcm_error` | (2,) | e_N, in two directions normal to the shaft [m] |
    | `insertion_depth` | (1,) | from the trocar to the tip along the shaft [m] |
    | `trocar_position` | (3,) | p_WC [m] |
    | `trocar_velocity` | (3,) | v_WC [m/s] |

    World frame; the kinematics are those of the nominal model.
    """
    command, p_WT = seen.command, seen.kin.p_WT
    observation = {
        "time": np.array([seen.t_s]),
        "joint_position": seen.q.copy(),
        "joint_velocity": seen.v.copy(),
        "tip_position": p_WT.copy(),
        "tip_error": p_WT - command.p_WTd,
        "command_velocity": command.v_WTd.copy(),
        "command_acceleration": command.a_WTd.copy(),
    }
    if seen.rcm is not None:
        observation["rcm_error"] = seen.rcm.error.copy()
        observation["insertion_depth"] = np.array([seen.rcm.depth])
        observation["trocar_position"] = seen.p_WC.copy()
        observation["trocar_velocity"] = seen.v_WC.copy()
    return observation
