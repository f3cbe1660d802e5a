"""Plants of the arm without a trocar, disturbed or not, and what their dynamics are."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.plant.dynamic import DynamicPlantConfig

DT = 0.001


def scene_of(*configs, instrument=True, seed=0):
    """The scene as disturbed by `configs`, and the disturbances."""
    disturbances = [config.build(np.random.default_rng([seed, i])) for i, config in enumerate(configs)]
    tool = {} if instrument else {"instrument": None}
    config = SceneConfig(robot=RobotConfig(name="lwr4plus"), theatre=False, **tool)
    return build(config, disturbances), disturbances


def plant_of(*configs, seed=0):
    scene, disturbances = scene_of(*configs, seed=seed)
    return DynamicPlantConfig().build(scene, DT, disturbances, np.random.SeedSequence(seed))


def inertia(scene, q):
    """M (7, 7) and the gravity torque (7,) at `q`."""
    data = mujoco.MjData(scene.model)
    data.qpos[:] = q
    mujoco.mj_forward(scene.model, data)
    M = np.empty((7, 7))
    mujoco.mj_fullM(scene.model, data, M)
    return M, data.qfrc_bias.copy()


@pytest.fixture(scope="session")
def disturbed():
    """The helpers of this file: `scene_of`, `plant_of`, `inertia`, `DT`."""
    return SimpleNamespace(scene_of=scene_of, plant_of=plant_of, inertia=inertia, DT=DT)
