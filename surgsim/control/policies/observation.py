"""What a policy sees at a tick: the same as any other controller, as named arrays."""

from collections.abc import Mapping

from surgsim.array import Array

Observation = Mapping[str, Array]


def observe(seen: Mapping[str, Array]) -> dict[str, Array]:
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

    Args:
        seen: Fields of a `surgsim.tick.arrays.Seen` by name, numbers as arrays (1,); they are copied.
    """
    p_WT = seen["p_WT"]
    observation = {
        "time": seen["t_s"].copy(),
        "joint_position": seen["q"].copy(),
        "joint_velocity": seen["v"].copy(),
        "tip_position": p_WT.copy(),
        "tip_error": p_WT - seen["p_WTd"],
        "command_velocity": seen["v_WTd"].copy(),
        "command_acceleration": seen["a_WTd"].copy(),
    }
    if seen["has_trocar"][0]:
        observation["rcm_error"] = seen["rcm_error"].copy()
        observation["insertion_depth"] = seen["depth"].copy()
        observation["trocar_position"] = seen["p_WC"].copy()
        observation["trocar_velocity"] = seen["v_WC"].copy()
    return observation
