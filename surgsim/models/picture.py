"""Still pictures of a scene, drawn without a window."""

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from surgsim.errors import SurgsimError, unknown_name
from surgsim.models.build import Scene


def render(
    scene: Scene, q: ArrayLike, camera: str = "overview", width: int = 1400, height: int = 900
) -> NDArray[np.uint8]:
    """Draw the scene with shadows, the arm at `q`.

    Args:
        scene: From `build`, with its theatre.
        q: Joint positions (n,) [rad].
        camera: Name of a camera in the scene.
        width: Pixels.
        height: Pixels.

    Returns:
        Picture (height, width, 3), RGB.

    Raises:
        SurgsimError: If the scene has no such camera or this machine cannot draw.
    """
    known = [scene.model.camera(i).name for i in range(scene.model.ncam)]
    if camera not in known:
        raise SurgsimError(f"camera: {unknown_name(camera, 'camera', known)}")
    data = mujoco.MjData(scene.model)
    data.qpos[scene.qpos_ids] = q
    mujoco.mj_forward(scene.model, data)
    with renderer(scene.model, width, height) as drawing:
        drawing.update_scene(data, camera)
        return np.array(drawing.render(), dtype=np.uint8)


def renderer(model: mujoco.MjModel, width: int, height: int, most_geoms: int = 10_000) -> mujoco.Renderer:
    """MuJoCo's renderer.

    Raises:
        SurgsimError: If the picture is too large, or this machine cannot draw.
    """
    try:
        return mujoco.Renderer(model, height=height, width=width, max_geom=most_geoms)
    except ValueError as error:
        raise SurgsimError(f"picture: {width}x{height} pixels: {error}") from error
    except (mujoco.FatalError, ImportError, AttributeError, OSError, RuntimeError) as error:
        raise SurgsimError(
            "picture: no OpenGL on this machine. Without a display, install libosmesa6 and set "
            f"MUJOCO_GL=osmesa, or install EGL and set MUJOCO_GL=egl. ({error})"
        ) from error
