"""The runs that are measured, by name."""

from collections.abc import Sequence
from dataclasses import dataclass

from surgsim.errors import SurgsimError, unknown_name
from surgsim.runs.part_origins import missing_package
from surgsim.scenario.arms import Experiment, each_arm
from surgsim.scenario.load import load_experiment, load_scenario, shipped
from surgsim.scenario.schema import Scenario

CIRCLE = "circle_lwr4plus"
WHOLE = ("theatre_lwr4plus", "theatre_ideal_lwr4plus", "teleop_free_motion_panda")
SEVERAL_ARMS = ("two_ports_lwr4plus",)
"""Scenarios that are measured with their own controller, of one arm and of several."""
KINEMATIC = ("pinv", "gradient", "vprnn", "qp")
"""Controllers that are measured on the kinematic plant too."""
_WALL, _SENSOR = "trocar.wall={}", "disturbances=[{type: force_torque_sensor}]"
NEEDS = {
    "rcm_interaction_force": (_WALL,),
    "rcm_port_admittance": (_WALL, _SENSOR),
    "hands_on_admittance": (_SENSOR,),
}
"""What a controller needs in the scenario to be run at all."""
OUTSIDE = ("external_torque", "external_velocity")
"""Controllers that need a program: a figure of theirs would be that program's."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A run that is measured.

    Attributes:
        name: What tables call it: a scenario, or `circle/` or `kinematic/` and a controller.
        source: The shipped scenario.
        controller: A shipped controller; None: the scenario's own.
        settings: Values instead of the scenario's.
    """

    name: str
    source: str
    controller: str | None = None
    settings: tuple[str, ...] = ()

    def scenario(self, *settings: str) -> Scenario:
        """The scenario of one arm, with further `settings`."""
        return load_scenario(self.source, controller=self.controller, assignments=(*self.settings, *settings))

    def experiment(self) -> Experiment:
        """The scenario, of one arm or of several."""
        return load_experiment(self.source, controller=self.controller, assignments=self.settings)

    def lacks(self) -> str:
        """The line about a package that its controller needs and that is not installed, or nothing."""
        lines = [missing_package(one.controller) for one in each_arm(self.experiment())]
        return next(filter(None, lines), "")

    @property
    def has_stages(self) -> bool:
        """Whether the stages of its tick can be measured: those of one arm."""
        return self.source not in SEVERAL_ARMS


def circle(controller: str) -> Case:
    """The circle with a shipped controller."""
    settings = NEEDS.get(controller, ())
    return Case(name=f"circle/{controller}", source=CIRCLE, controller=controller, settings=settings)


def kinematic(controller: str) -> Case:
    """The circle on the kinematic plant."""
    settings = ("plant={type: kinematic}", "theatre=false")
    return Case(name=f"kinematic/{controller}", source=CIRCLE, controller=controller, settings=settings)


def all_cases() -> list[Case]:
    """Every case, in the order of the tables."""
    whole = [Case(name=name, source=name) for name in (*WHOLE, *SEVERAL_ARMS)]
    controllers = [name for name in shipped("controllers") if name not in OUTSIDE]
    return [*map(circle, controllers), *whole, *map(kinematic, KINEMATIC)]


def chosen(names: Sequence[str] | None) -> list[Case]:
    """The cases of these names, in the order of the tables; all of them for None.

    Raises:
        SurgsimError: If one is not known.
    """
    cases = all_cases()
    known = [case.name for case in cases]
    for name in names or ():
        if name not in known:
            raise SurgsimError(unknown_name(name, "case", known))
    return [case for case in cases if names is None or case.name in names]
