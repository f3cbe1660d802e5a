"""A recorded run put back row by row: arms, ports and whatever else moves."""

from collections.abc import Sequence

import mujoco
import numpy as np

from surgsim.models.build import Scene
from surgsim.plant.other_joints import joint_columns
from surgsim.trace.trace import Trace


class Replay:
    """Forward kinematics of the recorded columns; nothing is simulated.

    Attributes:
        data: MuJoCo's data of the scene's model, where the last `place` put things.

    Args:
        scenes: The scenes of the arms that were simulated, in one model, or of one with more to look at.
        trace: The run.
    """

    def __init__(self, scenes: Scene | Sequence[Scene], trace: Trace) -> None:
        every = (scenes,) if isinstance(scenes, Scene) else tuple(scenes)
        self._model = every[0].model
        self.data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self.data)
        self._arms = [_Arm(scene, one, self.data) for scene, one in zip(every, trace.each(), strict=True)]

    def place(self, row: int) -> None:
        """Put everything where it was at a row of the trace; a port follows its trocar."""
        for arm in self._arms:
            arm.place(row)
        mujoco.mj_kinematics(self._model, self.data)

    def aim(self) -> None:
        """Put cameras and lights where `place` put their bodies."""
        mujoco.mj_camlight(self._model, self.data)


class _Arm:
    """An arm of the run, with its port and what else of it moves."""

    def __init__(self, scene: Scene, trace: Trace, data: mujoco.MjData) -> None:
        blocks, self._places = joint_columns(scene.parts)
        self._others = np.column_stack(
            [np.zeros((len(trace), 0)), *(trace.block(block.name) for block in blocks)]
        )
        self._qpos, self._q, self._q_places = data.qpos, trace.block("q"), scene.qpos_ids
        self._trocar = trace.block("trocar")
        self._port = None if scene.port_mocap is None else data.mocap_pos[scene.port_mocap]
        self._offset = np.zeros(3)
        if self._port is not None:
            self._offset = self._port - data.site_xpos[scene.trocar_site]

    def place(self, row: int) -> None:
        """Put it where it was."""
        self._qpos[self._q_places] = self._q[row]
        self._qpos[self._places] = self._others[row]
        if self._port is not None:
            self._port[:] = self._trocar[row] + self._offset
