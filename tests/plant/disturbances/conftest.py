"""Plants of the arm, disturbed or not, and what their dynamics are."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig, TrocarConfig
from surgsim.plant.dynamic import DynamicPlantConfig
from surgsim.plant.state import State

DT = 0.001
HOME = np.array([0.0, 0.55, 0.20])


def scene_of(*configs, instrument=True, seed=0, trocar=False, dt=DT):
    """The scene as disturbed by `configs`, and the disturbances."""
    disturbances = [config.build(np.random.default_rng([seed, i])) for i, config in enumerate(configs)]
    tool = {} if instrument else {"instrument": None}
    port = {"trocar": TrocarConfig(position_m=tuple(HOME))} if trocar else {}
    robot = RobotConfig(name="lwr4plus")
    config = SceneConfig(robot=robot, theatre=False, timestep_s=dt, **tool, **port)
    return build(config, disturbances), disturbances


def plant_of(*configs, seed=0, trocar=False, dt=DT, ledger=False):
    scene, disturbances = scene_of(*configs, seed=seed, trocar=trocar, dt=dt)
    plant = DynamicPlantConfig(energy_ledger=ledger)
    return plant.build(scene, DT, disturbances, np.random.SeedSequence(seed))


def inertia(scene, q):
    """M (7, 7) and the gravity torque (7,) at `q`."""
    data = mujoco.MjData(scene.model)
    data.qpos[:] = q
    mujoco.mj_forward(scene.model, data)
    M = np.empty((7, 7))
    mujoco.mj_fullM(scene.model, data, M)
    return M, data.qfrc_bias.copy()


def started(config, seed=0, dt=DT):
    """A disturbance of measurements or torques, started without a plant."""
    disturbance = config.build(np.random.default_rng(seed))
    disturbance.start(None, None, np.random.default_rng([seed, 1]), dt)
    return disturbance


def state_at(k, dt=DT, **given):
    """A state whose entries tell the tick `k`, except for those given."""
    values = {"q": np.full(7, 0.01 * k), "v": np.full(7, 0.02 * k), "tau": np.full(7, 1.0 * k)}
    values |= {"p_WC": HOME + 0.001 * k, "v_WC": np.zeros(3), "f_T": np.full(3, 0.1 * k)}
    return State(t_s=k * dt, **(values | given))


@pytest.fixture(scope="session")
def disturbed():
    """The helpers of this file."""
    return SimpleNamespace(
        scene_of=scene_of,
        plant_of=plant_of,
        inertia=inertia,
        started=started,
        state_at=state_at,
        DT=DT,
        HOME=HOME,
    )
