"""Many pictures of one scene, drawn without a window in one rendering context."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import TracebackType
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.models.picture import renderer
from surgsim.spatial import unit

Picture = NDArray[np.uint8]

# Processor time of a picture of 640 x 480 with 8 samples and a shadow map of 8192 is four times that without.
_SAMPLES = 0
_SHADOW_MAP = 2048
_NEAREST_M = 0.003
_ASPECT = 1.5  # width over height of a picture for which the theatre's cameras are placed
_MOST_GEOMS = 20_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """A line in the scene.

    Attributes:
        points: Its points (n, 3) [m], in the world.
        rgba: Its colour (4,), 0 to 1.
        width: Pixels.
        lift: How far it is drawn towards the camera, as a share of its distance, to be seen on what is there.
    """

    points: Array
    rgba: Array
    width: float
    lift: float = 0.0


@dataclass(frozen=True, kw_only=True)
class FixedCamera:
    """A camera for `build`, fixed to the world or to the tip.

    Attributes:
        name: Its name.
        position: Where it is (3,) [m].
        target: At what it looks (3,) [m].
        fovy_deg: Its field of view, from top to bottom.
        on_tip: Whether places are in the frame of site `tip`, z along the shaft, and it moves with the tip.
    """

    name: str
    position: Array
    target: Array
    fovy_deg: float
    on_tip: bool = False

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Add the camera."""
        forward = unit(self.target - self.position)
        up = np.array([0.0, 1.0, 0.0]) if self.on_tip else np.array([0.0, 0.0, 1.0])
        if abs(float(forward @ up)) > 1.0 - 1e-6:
            up = np.array([1.0, 0.0, 0.0])
        right = unit(np.cross(forward, up))
        turn, quat = np.column_stack([right, np.cross(right, forward), -forward]), np.zeros(4)
        mujoco.mju_mat2Quat(quat, turn.ravel())
        body, place = spec.worldbody, np.array(self.position, dtype=np.float64)
        if self.on_tip:
            site = spec.site("tip")
            body, inner = site.parent, quat.copy()
            mujoco.mju_rotVecQuat(place, np.array(self.position, dtype=np.float64), site.quat)
            place += site.pos
            mujoco.mju_mulQuat(quat, site.quat, inner)
        body.add_camera(name=self.name, pos=place, quat=quat, fovy=self.fovy_deg)


def widened(fovy_deg: Array, aspect: float) -> Array:
    """Fields of view (n,) [deg] with which a narrow picture shows from side to side what a wide one does.

    tan(f'/2) = tan(f/2) max(1, 3/2 / aspect)
    """
    share = max(1.0, _ASPECT / aspect)
    wide: Array = np.rad2deg(2.0 * np.arctan(share * np.tan(np.deg2rad(fovy_deg) / 2.0)))
    return wide


class Drawing:
    """What draws a model, again and again; a context manager that frees the graphics at its end.

    Args:
        model: The model; how fine it is drawn is changed in it.
        width: Pixels.
        height: Pixels.

    Raises:
        SurgsimError: If this machine cannot draw.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        model.vis.quality.offsamples, model.vis.quality.shadowsize = _SAMPLES, _SHADOW_MAP
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        model.vis.map.znear = _NEAREST_M / model.stat.extent
        model.cam_fovy[:] = widened(model.cam_fovy, width / height)
        self._model = model
        self._renderer = renderer(model, width, height, _MOST_GEOMS)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._renderer.close()

    def picture(
        self, data: mujoco.MjData, camera: str, hidden: Sequence[str] = (), lines: Sequence[Line] = ()
    ) -> Picture:
        """Draw what a camera sees (height, width, 3), RGB.

        Args:
            data: Where everything is, cameras and lights included.
            camera: Name of the camera.
            hidden: Materials that are left out.
            lines: Drawn too.
        """
        materials = [
            index for index in range(self._model.nmat) if self._model.mat(index).name.split("/")[-1] in hidden
        ]
        seen = self._model.mat_rgba[materials, 3].copy()
        self._model.mat_rgba[materials, 3] = 0.0
        self._renderer.update_scene(data, camera)
        self._model.mat_rgba[materials, 3] = seen
        for line in lines:
            self._add(line)
        return np.array(self._renderer.render(), dtype=np.uint8)

    def _add(self, line: Line) -> None:
        """Put a line's pieces into the scene that is drawn next."""
        scene, kind = self._renderer.scene, mujoco.mjtGeom.mjGEOM_LINE
        rgba = line.rgba.astype(np.float32)
        points = line.points + line.lift * (np.array(scene.camera[0].pos) - line.points)
        for start, end in pairwise(points):
            if scene.ngeom >= scene.maxgeom:
                return
            geom = scene.geoms[scene.ngeom]
            mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
            mujoco.mjv_connector(geom, kind, line.width, start, end)
            scene.ngeom += 1
