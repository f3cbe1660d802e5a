"""What is asked of a tuning, checked before anything is run."""

import re

from surgsim.catalog import check_name
from surgsim.compare.suite import parse_seeds
from surgsim.errors import ScenarioError, SurgsimError
from surgsim.models.robot import robot_joints
from surgsim.runs.part_origins import check_parts
from surgsim.scenario.arms import Experiment, each_arm
from surgsim.scenario.load import load_controller, load_experiment
from surgsim.tuning.gains import gains_of
from surgsim.tuning.tuning import Tuning, Wish

MOST_SEED = 2**32 - 1
_OF_AN_ARM = re.compile(r"arms\.\d+\.controller\b")


def prepare(wish: Wish) -> Tuning:
    """Check what is asked for.

    Raises:
        SurgsimError: If something is wrong with it.
    """
    load_controller(wish.controller)
    for setting in wish.settings:
        _check_setting(setting)
    if not 0 <= wish.seed <= MOST_SEED:
        raise SurgsimError(f"--seed: {wish.seed} is not allowed: must be 0 to {MOST_SEED}")
    scenarios = _scenarios(wish)
    check_parts(scenarios)
    controller = each_arm(scenarios[0])[0].controller
    joints = sorted({robot_joints(arm.robot) for scenario in scenarios for arm in each_arm(scenario)})
    if len(joints) > 1:
        arms = " and ".join(map(str, joints))
        raise SurgsimError(f"--scenario: arms of {arms} joints; tune for arms of one number of joints")
    tuning = Tuning(
        wish=wish,
        scenarios=scenarios,
        controller=controller,
        gains=gains_of(controller, joints[0], wish.keys),
    )
    try:
        check_name(tuning.name)
    except ValueError as error:
        raise SurgsimError(f"the tuned controller's name: {error}") from error
    each = len(scenarios)
    if wish.budget < 2 * each:
        raise SurgsimError(
            f"--budget: {wish.budget} is not allowed: must be {2 * each} or more, "
            f"a run for each scenario and seed ({each}) of the controller as it is and of one candidate"
        )
    return tuning


def _scenarios(wish: Wish) -> list[Experiment]:
    try:
        seeds = parse_seeds(wish.seeds)
    except ValueError as error:
        raise ScenarioError("--seeds", str(error)) from error
    found, names = [], set()
    for source in wish.scenarios:
        loaded = [
            load_experiment(source, controller=wish.controller, assignments=wish.settings, seed=seed)
            for seed in seeds
        ]
        if loaded[0].name in names:
            raise SurgsimError(f"--scenario: two scenarios are both '{loaded[0].name}'")
        names.add(loaded[0].name)
        found += loaded
    return found


def _check_setting(setting: str) -> None:
    """Refuse a setting of what has an option of its own."""
    key = setting.partition("=")[0].strip()
    if key == "seed":
        raise ScenarioError(f"--set {setting}", "the seeds of the runs are given by --seeds")
    if key == "controller" or _OF_AN_ARM.match(key):
        raise ScenarioError(f"--set {setting}", "the controller is the command's first argument")
