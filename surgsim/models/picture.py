"""Still pictures of a scene, drawn without a window."""

from collections.abc import Sequence
from typing import Any, cast

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from surgsim.errors import SurgsimError, unknown_name
from surgsim.models.build import Scene
from surgsim.packages import require


def render(
    scene: Scene | Sequence[Scene],
    q: ArrayLike | Sequence[ArrayLike],
    camera: str = "overview",
    width: int = 1400,
    height: int = 900,
) -> NDArray[np.uint8]:
    """Draw the scene with shadows, the arm at `q`.

    Args:
        scene: From `build`, with its theatre; of several arms those that `build_shared` gives.
        q: Joint positions (n,) [rad]; of several arms those of each.
        camera: Name of a camera in the scene.
        width: Pixels.
        height: Pixels.

    Returns:
        Picture (height, width, 3), RGB.

    Raises:
        SurgsimError: If the scene has no such camera or this machine cannot draw.
    """
    scenes, starts = ([scene], [q]) if isinstance(scene, Scene) else (list(scene), list(cast(Any, q)))
    model = scenes[0].model
    known = [model.camera(i).name for i in range(model.ncam)]
    if camera not in known:
        raise SurgsimError(f"camera: {unknown_name(camera, 'camera', known)}")
    data = mujoco.MjData(model)
    for one, positions in zip(scenes, starts, strict=True):
        data.qpos[one.qpos_ids] = positions
    mujoco.mj_forward(model, data)
    with renderer(model, width, height) as drawing:
        drawing.update_scene(data, camera)
        return np.array(drawing.render(), dtype=np.uint8)


def renderer(model: mujoco.MjModel, width: int, height: int, most_geoms: int = 10_000) -> mujoco.Renderer:
    """MuJoCo's renderer.

    Raises:
        SurgsimError: If the picture is too large, or this machine cannot draw.
    """
    require("pictures need", "OpenGL")
    try:
        return mujoco.Renderer(model, height=height, width=width, max_geom=most_geoms)
    except ValueError as error:
        raise SurgsimError(f"picture: {width}x{height} pixels: {error}") from error
    except (mujoco.FatalError, ImportError, AttributeError, OSError, RuntimeError) as error:
        raise SurgsimError(
            "picture: no OpenGL on this machine. Without a display, install libosmesa6 and set "
            f"MUJOCO_GL=osmesa, or install EGL and set MUJOCO_GL=egl. ({error})"
        ) from error
