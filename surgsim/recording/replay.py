"""A recorded run put back row by row: arm, port and whatever else moves."""

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
        scene: The scene that was simulated, or one with more to look at.
        trace: The run.
    """

    def __init__(self, scene: Scene, trace: Trace) -> None:
        self.data = mujoco.MjData(scene.model)
        self._model = scene.model
        mujoco.mj_kinematics(self._model, self.data)
        blocks, self._places = joint_columns(scene.parts)
        self._others = np.column_stack(
            [np.zeros((len(trace), 0)), *(trace.block(block.name) for block in blocks)]
        )
        self._q, self._q_places = trace.block("q"), scene.qpos_ids
        self._trocar = trace.block("trocar")
        self._port = None if scene.port_mocap is None else self.data.mocap_pos[scene.port_mocap]
        self._offset = np.zeros(3)
        if self._port is not None:
            self._offset = self._port - self.data.site_xpos[scene.trocar_site]

    def place(self, row: int) -> None:
        """Put everything where it was at a row of the trace; the port follows the trocar."""
        self.data.qpos[self._q_places] = self._q[row]
        self.data.qpos[self._places] = self._others[row]
        if self._port is not None:
            self._port[:] = self._trocar[row] + self._offset
        mujoco.mj_kinematics(self._model, self.data)

    def aim(self) -> None:
        """Put cameras and lights where `place` put their bodies."""
        mujoco.mj_camlight(self._model, self.data)
