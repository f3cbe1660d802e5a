"""An arm with an angled tip, and the same from the files by MuJoCo alone."""

from functools import lru_cache

import mujoco
import numpy as np

from surgsim.models.arm import ArmModel
from surgsim.models.config import InstrumentConfig, RobotConfig, SceneConfig
from surgsim.resources import resource_dir

HOOK = resource_dir("assets") / "tools" / "hook_30.xml"
SITES = ("shaft_entry", "shaft_end", "tip")


@lru_cache(maxsize=1)
def angled_arm() -> ArmModel:
    """LWR4+ with the hook."""
    hook = InstrumentConfig(name="hook_30")
    return ArmModel(SceneConfig(robot=RobotConfig(name="lwr4plus"), instrument=hook))


class OwnKinematics:
    """Entry, shaft's end and tip of the LWR4+ with the hook, from the two files and MuJoCo."""

    def __init__(self) -> None:
        arm = mujoco.MjSpec.from_file(str(resource_dir("assets") / "robots" / "lwr4plus" / "lwr4plus.xml"))
        arm.attach(mujoco.MjSpec.from_file(str(HOOK)), prefix="t/", site=arm.site("flange"))
        self.model = arm.compile()
        self.data = mujoco.MjData(self.model)

    def points(self, q: np.ndarray) -> tuple[np.ndarray, ...]:
        """Places of the sites of the hook (3,) [m]."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        return tuple(self.data.site(f"t/{name}").xpos.copy() for name in SITES)

    def distance(self, q: np.ndarray, p_WC: np.ndarray) -> float:
        """Of a port from the line through entry and end of the shaft [m]."""
        entry, end, _ = self.points(q)
        axis = (end - entry) / np.linalg.norm(end - entry)
        off = p_WC - entry
        return float(np.linalg.norm(off - (off @ axis) * axis))
