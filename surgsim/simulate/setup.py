"""Everything that a scenario needs, built and checked before the first tick."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeGuard

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.control.controller import Controller
from surgsim.errors import SurgsimError, UnreachableError
from surgsim.models.arm import ArmModel
from surgsim.models.build import Scene, build
from surgsim.models.config import TrocarConfig
from surgsim.plant.base import Plant
from surgsim.scenario.schema import Scenario
from surgsim.simulate.reach import Reach
from surgsim.simulate.start import Places, check_path, check_through_port, solve_start
from surgsim.tasks.base import EnteringTaskConfig, Task, TaskConfig, WeighsForce

MOST_TICKS = 4_000_000
MOST_STEPS = 200_000_000


@dataclass(frozen=True, kw_only=True)
class Setup:
    """Built parts of a scenario.

    Attributes:
        scenario: The scenario.
        scene: The plant's compiled model, disturbances included.
        arm: The controller's nominal model.
        task: Desired tip motion.
        plant: The plant, before its first reset.
        controller: The controller, before its first tick.
        q_start: Start configuration (n,) [rad].
    """

    scenario: Scenario
    scene: Scene
    arm: ArmModel
    task: Task
    plant: Plant
    controller: Controller
    q_start: Array

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model."""
        return self.scene.model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data."""
        return self.plant.data

    @property
    def duration_s(self) -> float:
        """How long the task lasts [s]."""
        return self.task.duration_s

    def close(self) -> None:
        """End what the controller has running outside."""
        self.controller.close()


def prepare(scenario: Scenario) -> Setup:
    """Build a scenario's parts, solve the start and check that the path can be reached.

    Raises:
        UnreachableError: If start or path cannot be reached through the trocar.
        SurgsimError: If the model does not compile.
    """
    parts = scenario.build_parts()
    arm = ArmModel(scenario.scene)
    q_start, task = beginning(scenario, arm)
    check_times(scenario, task)
    try:
        scene = build(scenario.scene, parts, drawn=False)
    except ValueError as error:
        raise SurgsimError(f"{scenario.name}: MuJoCo refuses the model: {error}") from error
    period = scenario.simulation.control_period_s
    plant = scenario.plant.build(scene, period, parts, scenario.run_seed())
    return Setup(
        scenario=scenario,
        scene=scene,
        arm=arm,
        task=task,
        plant=plant,
        controller=controller_of(scenario, arm),
        q_start=q_start,
    )


def controller_of(scenario: Scenario, arm: ArmModel) -> Controller:
    """The scenario's controller of its nominal `arm`."""
    return Controller(
        scenario.controller,
        arm,
        dt_s=scenario.simulation.control_period_s,
        has_trocar=scenario.trocar is not None,
        use_torque_law=scenario.plant.uses_torque,
    )


def check_times(scenario: Scenario, task: Task) -> None:
    """Refuse a run that is too long, and a disturbance that would never act.

    Raises:
        SurgsimError: With the reason.
    """
    _check_length(scenario, task)
    _check_beginnings(scenario, task)


def beginning(scenario: Scenario, arm: ArmModel) -> tuple[Array, Task]:
    """Start configuration (n,) [rad], and the task, of a scenario whose nominal arm is `arm`.

    Raises:
        UnreachableError: If start or path cannot be reached through the trocar.
        SurgsimError: If the task enters a port and there is none, or starts beside it.
    """
    q_start = _start_of(_start_key(scenario))
    return q_start, _build_task(scenario, _path_start(scenario, arm))


def _build_task(scenario: Scenario, start: Array) -> Task:
    """The task, its path beginning at `start` (3,) [m].

    Raises:
        SurgsimError: If it enters a port and there is none, or starts beside it, or the bent part of the
            instrument is too wide for the bore.
    """
    config, period = scenario.task, scenario.simulation.control_period_s
    if not _enters(config):
        task = config.build(start, period, scenario.task_seed())
        if isinstance(task, WeighsForce):
            task.force_acted_over(scenario.simulation.timestep_s)
        return task
    if scenario.trocar is None:
        raise SurgsimError(f"{scenario.name}: task '{config.type}' needs a trocar")
    _check_bore(scenario, scenario.trocar)
    p_ST = None if scenario.instrument is None else scenario.instrument.p_ST
    try:
        return config.build(start, period, scenario.task_seed(), trocar=scenario.trocar, p_ST=p_ST)
    except ValueError as error:
        raise SurgsimError(f"{scenario.name}: task: {error}") from error


def _check_bore(scenario: Scenario, trocar: TrocarConfig) -> None:
    """Refuse a bent part that does not go through the bore of a physical wall, the shaft along its axis."""
    instrument = scenario.instrument
    if instrument is None or trocar.wall is None or not instrument.p_ST.any():
        return
    width = 2.0 * instrument.tip_from_shaft_m[0] + instrument.shaft_diameter_m
    if width > trocar.bore_diameter_m:
        raise SurgsimError(
            f"{scenario.name}: with the shaft on its axis the instrument's bent part needs a bore of "
            f"{1e3 * width:.1f} mm, and this is one of {1e3 * trocar.bore_diameter_m:.1f} mm. Give a "
            f"trocar.bore_diameter_m of {width:.4f}, or trocar.wall: null"
        )


def _enters(config: TaskConfig) -> TypeGuard[EnteringTaskConfig]:
    """Whether the tip starts outside the patient."""
    return isinstance(config, EnteringTaskConfig) and config.enters_port


def _check_length(scenario: Scenario, task: Task) -> None:
    """Refuse a run that no memory holds, or whose end nobody would see."""
    counts = (
        ("control ticks", scenario.simulation.control_period_s, MOST_TICKS),
        ("time steps", scenario.simulation.timestep_s, MOST_STEPS),
    )
    for what, step_s, most in counts:
        count = task.duration_s / step_s
        if count > most:
            raise SurgsimError(
                f"{scenario.name}: the task lasts {task.duration_s:g} s, {count:.3g} {what} "
                f"of {step_s:g} s; at most {most:.0e} are allowed"
            )


def _check_beginnings(scenario: Scenario, task: Task) -> None:
    """Refuse a disturbance that would never act: the run would pass for a disturbed one.

    Raises:
        SurgsimError: For the first one that begins at or after the end of the run.
    """
    for i, disturbance in enumerate(scenario.disturbances):
        begins_s = disturbance.begins_s
        if begins_s >= task.duration_s:
            raise SurgsimError(
                f"{scenario.name}: disturbances.{i} starts at {begins_s:g} s, "
                f"the run ends at {task.duration_s:g} s"
            )


def _path_start(scenario: Scenario, arm: ArmModel) -> Array:
    """Where the path begins (3,) [m]: that of the tip, or through a port that of the shaft's end."""
    if scenario.task.start_m is not None:
        return np.array(scenario.task.start_m)
    kin = arm.kinematics(np.array(scenario.start.q_rad))
    return kin.p_WS if _enters(scenario.task) else kin.p_WT


def _led_arm(scenario: Scenario) -> ArmModel:
    """The nominal arm, its tip at what the task leads: at the shaft's end where it goes through the port."""
    scene = scenario.scene
    if scene.instrument is not None and _enters(scenario.task):
        scene = scene.model_copy(update={"instrument": scene.instrument.up_to_shaft_end()})
    return ArmModel(scene)


def _start_key(scenario: Scenario) -> str:
    """The scenario reduced to what start and reach depend on: not the seed, nor what disturbs the plant.

    A sensor stays: a controller may not go without it.
    """
    sensors = tuple(item for item in scenario.disturbances if item.measures_flange)
    return scenario.model_copy(update={"seed": 0, "disturbances": sensors}).model_dump_json()


@lru_cache(maxsize=256)
def _start_of(scenario_json: str) -> Array:
    """Start configuration (n,) [rad], with the path checked; found once for the runs of a batch."""
    scenario = Scenario.model_validate_json(scenario_json)
    arm = _led_arm(scenario)
    trocar, given = scenario.trocar, scenario.start.q_rad
    p_start = _path_start(scenario, arm)
    try:
        if trocar is not None:
            _check_port(scenario, trocar, [("the start at", p_start)])
        places = _build_task(scenario, p_start).reach()
        if trocar is not None:
            _check_port(scenario, trocar, places)
        reach = Reach(arm, scenario.scene)
        if given is None:
            q = _solved_start(scenario, arm, np.array([p_start, *(p for _, p in places)]))
        else:
            q = _checked_start(reach, arm, np.array(given), p_start)
        if trocar is not None:
            check_path(reach, places, q)
    except UnreachableError as error:
        raise UnreachableError(f"{scenario.name}: {error}") from error
    q.flags.writeable = False
    return q


def _check_port(scenario: Scenario, trocar: TrocarConfig, places: Places) -> None:
    """Refuse places that are no pose of the instrument through the port."""
    entering, instrument = _enters(scenario.task), scenario.instrument
    if entering and instrument is not None:
        instrument = instrument.up_to_shaft_end()
    for where, p in places:
        check_through_port(p, where, instrument, trocar, entering)


def _solved_start(scenario: Scenario, arm: ArmModel, places: Array) -> Array:
    posture = scenario.start.posture_rad
    return solve_start(
        arm,
        scenario.scene,
        places,
        posture=None if posture is None else np.array(posture),
        home=_home(arm),
        clear=scenario.safety.stop_at_collision,
    )


def _home(arm: ArmModel) -> Array:
    """The arm's own posture (n,) [rad]: that of its model, or the middle of its ranges."""
    home = arm.scene.home
    return 0.5 * (arm.limits.q_min + arm.limits.q_max) if home is None else home


def _checked_start(reach: Reach, arm: ArmModel, q: Array, p_start: Array) -> Array:
    """`q` as given, if it is inside the limits, on the path and through the trocar."""
    outside = np.flatnonzero((q < arm.limits.q_min) | (q > arm.limits.q_max))
    if outside.size:
        i = int(outside[0])
        raise UnreachableError(
            f"start.q_rad: joint {i + 1} at {q[i]:.4f} rad is outside "
            f"[{arm.limits.q_min[i]:.4f}, {arm.limits.q_max[i]:.4f}] rad"
        )
    tip, rcm = reach.miss(q, p_start)
    if tip > 1e-3 or rcm > 1e-3:
        raise UnreachableError(
            f"start.q_rad leaves the tip {1e3 * tip:.1f} mm from the path's start and the shaft "
            f"{1e3 * rcm:.1f} mm from the trocar; both must be within 1 mm"
        )
    return q
