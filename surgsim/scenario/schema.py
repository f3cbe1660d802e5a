"""The scenario: one experiment, every default explicit."""

import json
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    Field,
    NonNegativeInt,
    PositiveFloat,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)
from pydantic_core import PydanticCustomError

from surgsim.catalog import Name, PartConfig
from surgsim.control.controller import ControllerConfig
from surgsim.models.config import (
    InstrumentConfig,
    PatientConfig,
    PerJoint,
    RobotConfig,
    SceneConfig,
    TrocarConfig,
)
from surgsim.models.robot import robot_joints
from surgsim.plant import DEFAULT, PLANTS
from surgsim.plant.base import PlantConfig
from surgsim.plant.disturbances import DISTURBANCES
from surgsim.plant.disturbances.base import DisturbanceConfig
from surgsim.plant.drive import JointDrives
from surgsim.plant.part import PlantPart, PlantPartConfig
from surgsim.plant.props import PROPS
from surgsim.scenario.hashed import sha256_of_config
from surgsim.scenario.per_joint import check_lists
from surgsim.scenario.thresholds import ThresholdsConfig
from surgsim.tasks import TASKS
from surgsim.tasks.base import TaskConfig

if TYPE_CHECKING:  # what the rest of the package may use of a part, whichever it is
    AnyTask = TaskConfig
    AnyPlant = PlantConfig
    AnyDisturbance = DisturbanceConfig
    AnyProp = PlantPartConfig
else:
    AnyTask, AnyPlant = TASKS.union(), PLANTS.union()
    AnyDisturbance, AnyProp = DISTURBANCES.union(), PROPS.union()


def default_plant() -> AnyPlant:
    """The plant of a scenario that names none."""
    config: Any = PLANTS.config(DEFAULT)
    plant: AnyPlant = config()
    return plant


class StartConfig(PartConfig):
    """The start configuration: given, or solved so that the shaft passes through the trocar.

    Attributes:
        q_rad: Joint positions to start from as they are; null: solve them.
        posture_rad: Posture near which the solution is sought; null: the one with most room to the joint
            limits.
    """

    q_rad: PerJoint | None = None
    posture_rad: PerJoint | None = None


class SimulationConfig(PartConfig):
    """Time steps.

    Attributes:
        timestep_s: MuJoCo's integration step [s].
        control_period_s: Time between control ticks [s], a whole multiple of the timestep.
    """

    timestep_s: Annotated[float, Field(gt=0.0, le=0.02)] = 0.001
    control_period_s: Annotated[float, Field(gt=0.0, le=0.1)] = 0.001

    @model_validator(mode="after")
    def _whole_ratio(self) -> Self:
        ratio = self.control_period_s / self.timestep_s
        if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-9 * ratio:
            raise ValueError(
                f"control_period_s {self.control_period_s:g} must be a whole multiple of timestep_s "
                f"{self.timestep_s:g}, not {ratio:g} times it"
            )
        return self


class StopConfig(PartConfig):
    """How an arm is brought to rest and held after an outcome that stops it.

    Attributes:
        duration_s: How long the run is recorded on [s]; 0: not at all.
        torque_share: Share of the torque beyond what holds the arm that it brakes with.
        stiffness_per_s2: Proportional gain about the stopping motion, per unit inertia [1/s^2].
    """

    duration_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.5
    torque_share: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    stiffness_per_s2: PositiveFloat = 2500.0


class SafetyConfig(PartConfig):
    """Limits past which a run is stopped, as an outcome; null switches one off.

    Attributes:
        rcm_error_max_m: Distance of the shaft from the trocar [m].
        tip_error_max_m: Distance of the tip from its command [m].
        trocar_force_max_n: Force of the shaft on the abdominal wall [N]; needs `trocar.wall`.
        tip_force_max_n: Force of the surroundings on the tip [N]; needs something that can touch it.
        stop_at_collision: Whether contact of the arm with itself, the patient or the table ends the run.
        stop_at_joint_limit: Whether leaving the joint range ends the run.
        stop_at_velocity_limit: Whether exceeding a joint velocity limit ends the run.
        infeasible_ticks_max: Ticks in a row without an answer of the controller over which the arm is braked
            before that ends the run.
        stop: How the arm is stopped; null: the recording ends with the outcome.
    """

    rcm_error_max_m: PositiveFloat | None = 0.05
    tip_error_max_m: PositiveFloat | None = None
    trocar_force_max_n: PositiveFloat | None = None
    tip_force_max_n: PositiveFloat | None = None
    stop_at_collision: bool = True
    stop_at_joint_limit: bool = True
    stop_at_velocity_limit: bool = True
    infeasible_ticks_max: Annotated[int, Field(ge=0, le=1000)] = 0
    stop: StopConfig | None = StopConfig()


class RecordingConfig(PartConfig):
    """What the recording holds besides every control tick.

    Attributes:
        scene_rate_hz: How often the poses of the 3-D scene are stored [Hz].
    """

    scene_rate_hz: Annotated[float, Field(gt=0.0, le=1000.0)] = 50.0


class Scenario(PartConfig):
    """One experiment: scene, task, controller, plant, disturbances, limits, seed.

    It cannot be changed; `surgsim.load(scenario, ...)` gives a changed one.

    Example:
        >>> import surgsim
        >>> scenario = surgsim.load("circle_lwr4plus")
        >>> scenario.task.type, scenario.task.radius_m, scenario.simulation.control_period_s
        ('circle', 0.02, 0.001)
    """

    schema_version: Literal[1] = 1
    name: Name
    description: str = ""
    seed: NonNegativeInt = 0
    robot: RobotConfig
    instrument: InstrumentConfig | None = InstrumentConfig()
    trocar: TrocarConfig | None = None
    patient: PatientConfig | None = None
    theatre: bool = True
    start: StartConfig = StartConfig()
    task: AnyTask
    controller: ControllerConfig
    plant: AnyPlant = default_plant()
    disturbances: tuple[AnyDisturbance, ...] = ()
    props: tuple[AnyProp, ...] = ()
    simulation: SimulationConfig = SimulationConfig()
    safety: SafetyConfig = SafetyConfig()
    thresholds: ThresholdsConfig = ThresholdsConfig()
    recording: RecordingConfig = RecordingConfig()

    @model_validator(mode="after")
    def _fits_the_arm(self) -> Self:
        check_lists(self, self.robot)
        if self.robot.drives is not None:
            try:
                self.robot.drives.check_lengths(robot_joints(self.robot))
            except ValueError as error:
                placed = {"text": str(error), "at": ("robot", "drive")}
                raise PydanticCustomError("placed", "{text}", placed) from error
        return self

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.trocar is not None and self.instrument is None:
            raise ValueError("a trocar needs an instrument: set instrument, or trocar to null")
        if self.trocar is not None and self.instrument is not None:
            bore, shaft = self.trocar.bore_diameter_m, self.instrument.shaft_diameter_m
            if shaft >= bore:
                raise ValueError(f"instrument.shaft_diameter_m {shaft:g} must be below the bore, {bore:g}")
        if self.task.start_m is None and self.start.q_rad is None:
            raise ValueError("give task.start_m, or start.q_rad where the path then begins")
        if self.plant.uses_torque and self.controller.torque_law is None:
            raise ValueError(f"plant '{self.plant.type}' needs controller.torque_law")
        if self.robot.drives is not None and not self.plant.uses_torque:
            raise ValueError(f"robot.drive does not act on the '{self.plant.type}' plant: leave it ideal")
        commands = getattr(self.controller.torque_law, "commands_reference", False)
        if self.takes_joint_reference and not commands:
            raise ValueError(
                "robot.drive.command joint_impedance takes joint positions: controller.torque_law must be "
                "one that commands them, as joint_reference"
            )
        for key in ("disturbances", "props"):
            if getattr(self, key) and not self.plant.uses_torque:
                raise ValueError(f"{key} do not act on the '{self.plant.type}' plant: leave them out")
        if self.trocar is not None and self.trocar.wall is not None:
            if not self.plant.uses_torque:
                raise ValueError(f"a trocar.wall does not act on the '{self.plant.type}' plant: leave it out")
            self.trocar.wall.check_timestep(self.simulation.timestep_s)
        self.task.check(self)
        self.plant.check(self)
        self.controller.check(self)
        parts: tuple[PlantPartConfig, ...] = (*self.disturbances, *self.props)
        for part in parts:
            part.check(self)
        return self

    @model_serializer(mode="wrap")
    def _without_a_default_patient(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Where the patient lies is left out where it follows from the port."""
        every: dict[str, Any] = write(self)
        return {key: value for key, value in every.items() if key != "patient" or value is not None}

    @property
    def control_period_s(self) -> float:
        """Time between control ticks [s]."""
        return self.simulation.control_period_s

    @property
    def controller_name(self) -> str:
        """Name of the controller."""
        return self.controller.name

    @property
    def has_wall(self) -> bool:
        """Whether there is a physical wall around the trocar."""
        return self.trocar is not None and self.trocar.wall is not None

    @property
    def has_force_sensor(self) -> bool:
        """Whether there is a force-torque sensor at the flange."""
        return any(item.measures_flange for item in self.disturbances)

    @property
    def has_drives(self) -> bool:
        """Whether the arm's joints have motors behind elastic gears."""
        return self.robot.drives is not None

    @property
    def takes_joint_reference(self) -> bool:
        """Whether the arm's own impedance loop is commanded joint positions."""
        return self.robot.drives is not None and self.robot.drives.impedes

    @property
    def rolls_instrument(self) -> bool:
        """Whether the task needs the instrument to be rolled."""
        return bool(getattr(self.task, "rolls_instrument", False))

    @property
    def scene(self) -> SceneConfig:
        """What is compiled into the MuJoCo model."""
        return SceneConfig(
            robot=self.robot,
            instrument=self.instrument,
            trocar=self.trocar,
            patient=self.patient,
            theatre=self.theatre,
            timestep_s=self.simulation.timestep_s,
        )

    def build_parts(self) -> list[PlantPart]:
        """Disturbances, props, then the drives, each with values drawn from its own child of the seed."""
        configs: tuple[PlantPartConfig, ...] = (*self.disturbances, *self.props)
        children = np.random.SeedSequence(self.seed, spawn_key=(0,)).spawn(len(configs) + 1)
        pairs = zip(configs, children, strict=False)
        parts = [config.build(np.random.default_rng(child)) for config, child in pairs]
        drives = self.robot.drives
        if drives is None:
            return parts
        return [*parts, JointDrives(drives, np.random.default_rng(children[-1]), self.scene)]

    def run_seed(self) -> np.random.SeedSequence:
        """Where the randomness during a run comes from."""
        return np.random.SeedSequence(self.seed, spawn_key=(1,))

    def task_seed(self) -> np.random.SeedSequence:
        """Where the randomness of a task comes from, e.g. of a simulated operator."""
        return np.random.SeedSequence(self.seed, spawn_key=(2,))

    def resolved(self) -> dict[str, Any]:
        """Every key with its value, as plain data that loads to the same scenario."""
        data: dict[str, Any] = json.loads(self.model_dump_json())
        return data

    def sha256(self) -> str:
        """Hash of what can change a run; of a file that it names the content counts, not where it stands."""
        return sha256_of_config(self)
