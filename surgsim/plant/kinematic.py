"""Kinematic plant: perfect velocity tracking, the setting of the manipulability paper."""

from collections.abc import Sequence
from typing import Literal

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.columns import Block
from surgsim.compiled import address_of, as_parameter, compiled
from surgsim.models.build import Scene
from surgsim.plant.base import Plant
from surgsim.plant.bore import Bore
from surgsim.plant.contacts import ContactWatch
from surgsim.plant.part import PlantPart
from surgsim.plant.period import COMMANDED, SEEN, see_arm
from surgsim.plant.records import world_of
from surgsim.plant.state import State
from surgsim.plant.truth import Truth
from surgsim.plant.world import Hooks, HookTable, advance_signature, measured
from surgsim.tick.arrays import World, new
from surgsim.tick.mujoco_calls import mj_kinematics
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import vector


class KinematicPlantConfig(PartConfig):
    """Integrates the resolver's joint velocities exactly; no dynamics."""

    type: Literal["kinematic"] = "kinematic"

    @property
    def uses_torque(self) -> bool:
        """Whether the plant is driven by torques."""
        return False

    def build(
        self, scene: Scene, control_period_s: float, parts: Sequence[PlantPart], seed: np.random.SeedSequence
    ) -> Plant:
        """The plant; disturbances and props do not act on it."""
        return KinematicPlant(scene, control_period_s)


@compiled
def look_at_kinematics(world: World) -> None:
    """Place the model and fill what is true and measured."""
    mj_kinematics(world.mj_model, world.mj_data)
    see_arm(world)


@compiled
def integrate(world: World) -> None:
    """q(k+1) = q(k) + T q'(k), eq. (5) of the manipulability paper."""
    qpos, qvel = vector(world.qpos, world.nq), vector(world.qvel, world.nv)
    world.tick += 1
    world.t_s = world.tick * world.dt_s
    for i in range(world.q.size):
        qpos[world.first_qpos + i] += world.dt_s * world.qdot[i]
        qvel[world.first_dof + i] = world.qdot[i]


@compiled
def advance_kinematics(world: World, bore: Bore, hooks: Hooks) -> int:
    """A control period, see `integrate`; torque and jaws do nothing."""
    integrate(world)
    look_at_kinematics(world)
    return GOES_ON


@compiled
def of_several_kinematic(stage: int, k: int, world: World, bore: Bore, hooks: Hooks) -> int:
    """A stage of the period for one of several arms; between two the model is placed for all."""
    if stage == COMMANDED:
        integrate(world)
    elif stage == SEEN:
        see_arm(world)
    return GOES_ON


class KinematicPlant:
    """Follows the resolver's joint velocities exactly. One of several arms is given the data that all share.

    Attributes:
        world: The arrays of the plant.
        bore: There is no physical port.
        advance: Address of the kernel of a control period.
    """

    columns: tuple[Block, ...] = ()

    def __init__(self, scene: Scene, control_period_s: float, *, data: mujoco.MjData | None = None) -> None:
        self._scene = scene
        self._data = mujoco.MjData(scene.model) if data is None else data
        n = len(scene.dof_ids)
        self.world, self.bore = world_of(scene, self._data, control_period_s), new(Bore, n)
        self.hooks = HookTable((), (), n, self.world)
        self._advance = as_parameter(advance_kinematics, advance_signature(n))
        self.advance = address_of(advance_kinematics, advance_signature(n))
        self.watch = ContactWatch(scene, self._data)

    @property
    def scene(self) -> Scene:
        """The scene of its arm."""
        return self._scene

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data; the plant alone writes them."""
        return self._data

    @property
    def objects(self) -> dict[str, object]:
        """What of the plant is a Python object with a state: nothing."""
        return {}

    @property
    def arrays(self) -> dict[str, Array]:
        """The rest of its state: nothing."""
        return {}

    def reset(self, q: Array) -> State:
        """Put the arm at rest at joint positions `q` (n,) [rad]."""
        mujoco.mj_resetData(self._scene.model, self._data)
        self.pose(q)
        self.forget()
        look_at_kinematics(self.world)
        return self.state()

    def pose(self, q: Array) -> None:
        """Put the arm at joint positions `q` (n,) [rad]; nothing looks at it yet."""
        self._data.qpos[self._scene.qpos_ids] = q

    def forget(self) -> None:
        """Forget the last run."""
        self.world.tick, self.world.t_s = 0, 0.0

    def step(self, torque: Array, qdot: Array, jaw: float = 0.0) -> State:
        """Move with velocity `qdot` (n,) [rad/s] for one control period; torque and jaws do nothing."""
        self.world.qdot[:] = qdot
        self._advance(self.world, self.bore, self.hooks.record)
        return self.state()

    def refill(self) -> None:
        """There is nothing to draw."""

    def state(self) -> State:
        """A copy of what is measured now."""
        return measured(self.world)

    def truth(self) -> Truth:
        """Where things are now."""
        world = self.world
        return Truth(
            q=world.q.copy(),
            v=world.v.copy(),
            p_WT=world.p_WT.copy(),
            p_WS=world.p_WS.copy(),
            p_WR=world.p_WR.copy(),
            p_WC=world.p_WC.copy(),
            contact=self.watch.look(world.p_WC),
        )
