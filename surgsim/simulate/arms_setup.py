"""Everything that a scenario of several arms needs, built and checked before the first tick."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco

from surgsim.errors import SurgsimError, UnreachableError
from surgsim.models.arm import ArmModel
from surgsim.models.build import SharedArm, build_shared
from surgsim.plant.between import ArmsWatch
from surgsim.plant.dynamic import DynamicPlant, DynamicPlantConfig
from surgsim.plant.kinematic import KinematicPlant, KinematicPlantConfig
from surgsim.plant.several import SharedPlant
from surgsim.scenario.arms import ArmsScenario
from surgsim.simulate.setup import Setup, beginning, check_times, controller_of


@dataclass(frozen=True, kw_only=True)
class ArmsSetup:
    """Built parts of a scenario of several arms.

    Attributes:
        scenario: The scenario.
        arms: The parts of each arm by its name; all have one model.
        plants: Their plants, on the same data.
        data: MuJoCo's data.
        watch: Looks for contact between the arms.
    """

    scenario: ArmsScenario
    arms: Mapping[str, Setup]
    plants: tuple[SharedPlant, ...]
    data: mujoco.MjData
    watch: ArmsWatch

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model, which all share."""
        return self.plants[0].scene.model

    @property
    def duration_s(self) -> float:
        """How long the longest of the tasks lasts [s]."""
        return max(arm.task.duration_s for arm in self.arms.values())

    def close(self) -> None:
        """End what controllers have running outside."""
        for arm in self.arms.values():
            arm.controller.close()


def prepare_arms(scenario: ArmsScenario) -> ArmsSetup:
    """Build the arms' parts, solve their starts, and check that each path can be reached.

    Raises:
        UnreachableError: If a start or path cannot be reached through its trocar, or arms touch at the start.
        SurgsimError: If the model does not compile.
    """
    each = {name: scenario.of(name) for name in scenario.names}
    nominal, begins = {name: ArmModel(one.scene) for name, one in each.items()}, {}
    for name, one in each.items():
        with naming_arm(scenario.name, name):
            begins[name] = beginning(one, nominal[name])
            check_times(one, begins[name][1])
    parts = {name: one.build_parts() for name, one in each.items()}
    try:
        shared = [SharedArm(name=k, config=one.scene, modifiers=parts[k]) for k, one in each.items()]
        scenes = dict(zip(each, build_shared(shared, drawn=False), strict=True))
    except ValueError as error:
        raise SurgsimError(f"{scenario.name}: MuJoCo refuses the model: {error}") from error
    model = scenes[scenario.names[0]].model
    data, period = mujoco.MjData(model), scenario.simulation.control_period_s
    stopping = frozenset(name for name, one in each.items() if one.safety.stop_at_collision)
    watch = ArmsWatch(list(scenes.items()), data, stopping)
    for name, scene in scenes.items():
        data.qpos[scene.qpos_ids] = begins[name][0]
    mujoco.mj_kinematics(model, data)
    if touching := watch.look():
        raise UnreachableError(f"{scenario.name}: the arms touch at the start: {touching}")
    arms, plants = dict[str, Setup](), list[SharedPlant]()
    for name, one in each.items():
        with naming_arm(scenario.name, name):
            plant: SharedPlant
            if isinstance(one.plant, DynamicPlantConfig):
                seed, books = one.run_seed(), one.plant.energy_ledger
                plant = DynamicPlant(scenes[name], period, parts[name], seed, energy_ledger=books, data=data)
            elif isinstance(one.plant, KinematicPlantConfig):
                plant = KinematicPlant(scenes[name], period, data=data)
            else:
                raise SurgsimError(f"several arms share a dynamic or kinematic plant, not '{one.plant.type}'")
            arms[name] = Setup(
                scenario=one,
                scene=scenes[name],
                arm=nominal[name],
                task=begins[name][1],
                plant=plant,
                controller=controller_of(one, nominal[name]),
                q_start=begins[name][0],
            )
            plants.append(plant)
    return ArmsSetup(scenario=scenario, arms=arms, plants=tuple(plants), data=data, watch=watch)


@contextmanager
def naming_arm(scenario: str, arm: str) -> Iterator[None]:
    """Have what is wrong with one arm say which it is."""
    try:
        yield
    except SurgsimError as error:
        kind = UnreachableError if isinstance(error, UnreachableError) else SurgsimError
        raise kind(f"{scenario}: arm {arm}: {str(error).removeprefix(f'{scenario}: ')}") from error
