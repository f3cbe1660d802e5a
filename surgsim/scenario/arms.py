"""The scenario of several arms in one patient: what they share, and for each what a scenario of one has.

An arm of it is a scenario of one arm (`ArmsScenario.of`): whatever is built, recorded and judged of one arm
is built, recorded and judged of each. Only the model and its time are shared.
"""

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    Field,
    NonNegativeInt,
    SerializerFunctionWrapHandler,
    ValidationError,
    field_validator,
    model_serializer,
    model_validator,
)
from pydantic_core import PydanticCustomError

from surgsim.catalog import Name, PartConfig
from surgsim.control.controller import ControllerConfig
from surgsim.display import joined_names
from surgsim.errors import SurgsimError, UnknownNameError, unknown_name
from surgsim.models.build import Scene, SharedArm, build, build_shared
from surgsim.models.collision import abdomen_semi_axes
from surgsim.models.config import InstrumentConfig, PatientConfig, RobotConfig, TrocarConfig
from surgsim.models.theatre import patient_place
from surgsim.plant.disturbances import DISTURBANCES
from surgsim.plant.disturbances.base import DisturbanceConfig
from surgsim.scenario.hashed import sha256_of_config
from surgsim.scenario.schema import (
    AnyPlant,
    RecordingConfig,
    SafetyConfig,
    Scenario,
    SimulationConfig,
    StartConfig,
    default_plant,
)
from surgsim.scenario.thresholds import ThresholdsConfig
from surgsim.tasks import TASKS
from surgsim.tasks.base import TaskConfig

if TYPE_CHECKING:
    AnyTask = TaskConfig
    AnyDisturbance = DisturbanceConfig
else:
    AnyTask, AnyDisturbance = TASKS.union(), DISTURBANCES.union()

MOST_ARMS = 4
_SEEDS = 3
"""Branch of the seed that the arms' seeds are children of; 0 to 2 are those of a scenario's own parts."""
_EACH = "give it to each of the arms, as arms.0."
NOT_BESIDE_ARMS = {
    **{key: f"{_EACH}{key}" for key in ("robot", "instrument", "trocar", "start", "task", "controller")},
    "props": "what an arm grasps or touches is for one arm alone; leave it out, or run one arm",
}
"""Keys of a scenario of one arm that one of several does not have, and why."""


class ArmConfig(PartConfig):
    """One of several arms.

    Attributes:
        name: What it is called; its columns and metrics begin with it and `_`.
        safety: Its own limits; null: those of the scenario.
        disturbances: That act on this arm, after those of the scenario.
    """

    name: Name
    robot: RobotConfig
    instrument: InstrumentConfig | None = InstrumentConfig()
    trocar: TrocarConfig | None = None
    start: StartConfig = StartConfig()
    task: AnyTask
    controller: ControllerConfig
    disturbances: tuple[AnyDisturbance, ...] = ()
    safety: SafetyConfig | None = None


class ArmsScenario(PartConfig):
    """An experiment of several arms around one patient.

    Example:
        >>> from surgsim.scenario.load import load_experiment
        >>> scenario = load_experiment("two_ports_panda")
        >>> scenario.names, scenario.of("left").task.type
        (('left', 'right'), 'circle')

    Attributes:
        arms: The arms.
        plant: Of all arms, which share one model.
        disturbances: That act on every arm, on each with draws of its own.
        patient: Where the patient lies; null: under the first port, as with one arm.
    """

    schema_version: Literal[1] = 1
    name: Name
    description: str = ""
    seed: NonNegativeInt = 0
    arms: Annotated[tuple[ArmConfig, ...], Field(min_length=2, max_length=MOST_ARMS)]
    patient: PatientConfig | None = None
    theatre: bool = True
    plant: AnyPlant = default_plant()
    disturbances: tuple[AnyDisturbance, ...] = ()
    simulation: SimulationConfig = SimulationConfig()
    safety: SafetyConfig = SafetyConfig()
    thresholds: ThresholdsConfig = ThresholdsConfig()
    recording: RecordingConfig = RecordingConfig()

    @field_validator("arms")
    @classmethod
    def _names_tell_them_apart(cls, arms: tuple[ArmConfig, ...]) -> tuple[ArmConfig, ...]:
        for k, arm in enumerate(arms):
            for other in arms[:k]:
                if f"{arm.name}_".startswith(f"{other.name}_") or f"{other.name}_".startswith(f"{arm.name}_"):
                    text = (
                        f"'{arm.name}' and '{other.name}' cannot be told apart at the beginning of a "
                        "column's name: neither may be, or begin with, the other and '_'"
                    )
                    raise PydanticCustomError("placed", "{text}", {"text": text, "at": (k, "name")})
        return arms

    @model_serializer(mode="wrap")
    def _without_the_usual_plant(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The usual plant is left out: scenarios with another one came later, and hashes stay."""
        every: dict[str, Any] = write(self)
        return {key: v for key, v in every.items() if key != "plant" or self.plant != default_plant()}

    @model_validator(mode="after")
    def _every_arm_is_a_scenario(self) -> Self:
        for k, arm in enumerate(self.arms):
            try:
                self.of(arm.name)
            except ValidationError as error:
                first = error.errors()[0]
                context = first.get("ctx", {})
                text = str(context.get("text") or context.get("error") or first["msg"])
                at = ("arms", k, *context.get("at", first["loc"]))
                raise PydanticCustomError("placed", "{text}", {"text": text, "at": at}) from error
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arms."""
        return tuple(arm.name for arm in self.arms)

    @property
    def controller_name(self) -> str:
        """Name of the controllers, once where all arms have the same."""
        return joined_names(arm.controller.name for arm in self.arms)

    def of(self, arm: str) -> Scenario:
        """The scenario of one arm alone: where no arm touches another, it gives the arm's trace.

        Raises:
            UnknownNameError: If there is no such arm.
        """
        key = (self.model_dump_json(), arm)
        if key not in _MADE:
            made = self._scenario_of(index_of(arm, self.names))
            if len(_MADE) >= _MOST_MADE:
                _MADE.clear()
            _MADE[key] = made
        return _MADE[key]

    def _scenario_of(self, k: int) -> Scenario:
        arm = self.arms[k]
        return Scenario(
            name=self.name,
            description=self.description,
            seed=arm_seed(self.seed, k),
            robot=arm.robot,
            instrument=arm.instrument,
            trocar=arm.trocar,
            patient=self._patient_of(k),
            theatre=self.theatre,
            start=arm.start,
            task=arm.task,
            controller=arm.controller,
            plant=self.plant,
            disturbances=(*self.disturbances, *arm.disturbances),
            simulation=self.simulation,
            safety=arm.safety or self.safety,
            thresholds=self.thresholds,
            recording=self.recording,
        )

    def _patient_of(self, k: int) -> PatientConfig | None:
        """Where the patient lies for arm k: all have the same, under the first port."""
        hosts = [i for i, arm in enumerate(self.arms) if arm.trocar is not None]
        if self.patient is not None or self.arms[k].trocar is None or hosts[0] == k:
            return self.patient
        host = self._scenario_of(hosts[0])
        assert host.trocar is not None
        centre, yaw = patient_place(host.scene, host.trocar, abdomen_semi_axes())
        return PatientConfig(position_m=(float(centre[0]), float(centre[1]), float(centre[2])), yaw_rad=yaw)

    def resolved(self) -> dict[str, Any]:
        """Every key with its value, as plain data that loads to the same scenario."""
        data: dict[str, Any] = json.loads(self.model_dump_json())
        return data

    def sha256(self) -> str:
        """Hash of what can change a run; of a file that it names the content counts, not where it stands."""
        return sha256_of_config(self)


_MADE: dict[tuple[str, str], Scenario] = {}
_MOST_MADE = 64
"""Scenarios of arms that were made, by the whole scenario and the arm: each is asked for again and again."""

Experiment = Scenario | ArmsScenario
"""A scenario of one arm, or of several."""


def each_arm(scenario: Experiment) -> tuple[Scenario, ...]:
    """The scenarios of the arms: of one alone that scenario itself."""
    if isinstance(scenario, ArmsScenario):
        return tuple(scenario.of(name) for name in scenario.names)
    return (scenario,)


def drawn_scenes(scenario: Experiment) -> tuple[Scene, ...]:
    """The arms in the theatre, without disturbances: what a picture of the scenario shows.

    Raises:
        SurgsimError: As `surgsim.models.build.build`.
    """
    configs = [one.scene.model_copy(update={"theatre": True}) for one in each_arm(scenario)]
    if not isinstance(scenario, ArmsScenario):
        return (build(configs[0]),)
    pairs = zip(scenario.names, configs, strict=True)
    return build_shared([SharedArm(name=name, config=config) for name, config in pairs])


def arm_seed(seed: int, k: int) -> int:
    """The seed of arm k, a child of that of the scenario."""
    return int(np.random.SeedSequence(seed, spawn_key=(_SEEDS, k)).generate_state(1)[0])


def index_of(arm: str, names: tuple[str, ...]) -> int:
    """Which arm it is.

    Raises:
        UnknownNameError: If there is no such arm.
    """
    if arm not in names:
        raise UnknownNameError(unknown_name(arm, "arm of this scenario", names))
    return names.index(arm)


def experiment_of(resolved: Mapping[str, Any]) -> Experiment:
    """The scenario that plain data are.

    Raises:
        pydantic.ValidationError: If they are none.
    """
    kind: type[Scenario] | type[ArmsScenario] = ArmsScenario if "arms" in resolved else Scenario
    return kind.model_validate_json(json.dumps(resolved))


def arms_of(resolved: Mapping[str, Any]) -> ArmsScenario:
    """The scenario of several arms that plain data of a recorded run are.

    Raises:
        SurgsimError: If it does not load in this installation.
    """
    try:
        return ArmsScenario.model_validate_json(json.dumps(resolved))
    except ValidationError as error:
        said = " ".join(str(error.errors()[0]["msg"]).split())
        raise SurgsimError(f"the scenario of this trace does not load: {said}") from error
