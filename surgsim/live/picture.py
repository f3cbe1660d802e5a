"""The drawn scene, put where the truth says that things are."""

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.build import build
from surgsim.plant.other_joints import joint_columns
from surgsim.plant.truth import Truth
from surgsim.simulate.setup import Setup

_FROM_TIP_M = 0.16
_ELEVATION_DEG = -35.0


class Picture:
    """A model of its own for the window, with the theatre, without shadows and mirroring floor.

    So the plant's data stay its own, and a computer without graphics card draws several pictures a second.

    Attributes:
        model: What is drawn.
        data: Its state.
    """

    def __init__(self, setup: Setup) -> None:
        scenario = setup.scenario
        self._scene = build(scenario.scene, scenario.build_parts())
        self.model = self._scene.model
        self.model.light_castshadow[:] = 0
        self.model.mat_reflectance[:] = 0.0
        self.model.vis.quality.offsamples = 0
        self.data = mujoco.MjData(self.model)
        self.data.qpos[self._scene.qpos_ids] = setup.q_start
        mujoco.mj_kinematics(self.model, self.data)
        self._blocks, self._places = joint_columns(self._scene.parts)
        self._columns = [name for block in setup.plant.columns for name in block.columns]
        mocap = self._scene.port_mocap
        self._offset = None
        if mocap is not None:
            self._offset = self.data.mocap_pos[mocap] - self.data.site_xpos[self._scene.trocar_site]

    def place(self, truth: Truth) -> None:
        """Put arm, port and whatever else moves where it is."""
        self.data.qpos[self._scene.qpos_ids] = truth.q
        others = [name for block in self._blocks for name in block.columns]
        self.data.qpos[self._places] = [truth.values[self._columns.index(name)] for name in others]
        if self._offset is not None:
            self.data.mocap_pos[self._scene.port_mocap] = truth.p_WC + self._offset

    def aim(self, camera: mujoco.MjvCamera) -> None:
        """Look at the tip from behind and above, inside the patient, with the robot's base at the back."""
        tip = self.data.site_xpos[self._scene.tip_site]
        base = self.data.xpos[self.model.body("base").id]
        camera.lookat[:] = tip - np.array([0.0, 0.0, 0.02])
        camera.distance, camera.elevation = _FROM_TIP_M, _ELEVATION_DEG
        camera.azimuth = np.rad2deg(np.arctan2(tip[1] - base[1], tip[0] - base[0]))


def screen_axes(camera: mujoco.MjvCamera) -> Array:
    """Columns: right and away on the screen, both level, and up, in the world (3, 3)."""
    azimuth = np.deg2rad(camera.azimuth)
    c, s = np.cos(azimuth), np.sin(azimuth)
    return np.array([[s, c, 0.0], [-c, s, 0.0], [0.0, 0.0, 1.0]])
