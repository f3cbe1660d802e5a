"""Plants of the arm, disturbed or not, and what their dynamics are."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig, TrocarConfig
from surgsim.plant.dynamic import DynamicPlantConfig
from surgsim.plant.part import BLOCK_TICKS
from surgsim.plant.records import world_of
from surgsim.plant.state import State
from surgsim.plant.world import measured
from surgsim.tick.status import GOES_ON

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


class Started:
    """A disturbance whose kernels are called one by one, in a scene whose arm does not move."""

    def __init__(self, config, seed=0, dt=DT, scene=None, q=None):
        self.part = config.build(np.random.default_rng(seed))
        self.scene = scene or scene_of(config, trocar=True)[0]
        self.data = mujoco.MjData(self.scene.model)
        if q is not None:
            self.data.qpos[:] = q
        mujoco.mj_forward(self.scene.model, self.data)
        self.dt = dt
        self.world = world_of(self.scene, self.data, dt)
        self.part.attach(self.scene, dt)
        self.start([seed, 1])

    def start(self, seed):
        """Begin again."""
        self.part.start(self.scene, self.data, np.random.default_rng(seed), self.dt)
        self.memory, self.filled = self.part.memory.copy(), -1

    def fill(self, tick):
        """Let the part draw what a tick needs."""
        if tick // BLOCK_TICKS != self.filled:
            self.filled = tick // BLOCK_TICKS
            self.part.refill(self.memory)

    def call(self, name, tick):
        """Call a hook at a tick."""
        self.world.tick = tick
        assert self.part.kernels[name](self.part.gains, self.world, self.memory, np.zeros(0)) == GOES_ON

    def sense(self, states):
        """What is measured of one state a tick."""
        found = []
        for k, state in enumerate(states):
            world = self.world
            world.t_s, world.q_m[:], world.v_m[:], world.tau_m[:] = state.t_s, state.q, state.v, state.tau
            world.p_WC_m[:], world.v_WC_m[:], world.f_T_m[:] = state.p_WC, state.v_WC, state.f_T
            self.fill(max(k - 1, 0))  # it is measured at the end of the tick before
            self.call("sense", k)
            found.append(measured(world))
        return found

    def actuate(self, torques):
        """What acts of one torque a tick."""
        acting = []
        for k, torque in enumerate(torques):
            self.world.torque[:] = torque
            self.fill(k)
            self.call("actuate", k)
            acting.append(self.world.torque.copy())
        return np.array(acting)

    def push(self, t_s, tick=0):
        """Forces and torques on all bodies at a time (bodies, 6)."""
        self.data.xfrc_applied[:] = 0.0
        self.world.step_s = t_s
        self.fill(tick)
        self.call("push", tick)
        return self.data.xfrc_applied.copy()

    def port_motion(self, t_s):
        """Offset and velocity of the port at a time."""
        self.world.step_s, self.world.port_offset[:], self.world.port_velocity[:] = t_s, 0.0, 0.0
        self.call("port_motion", 0)
        return self.world.port_offset.copy(), self.world.port_velocity.copy()


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
        started=Started,
        state_at=state_at,
        DT=DT,
        HOME=HOME,
    )
