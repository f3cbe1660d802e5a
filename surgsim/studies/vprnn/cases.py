"""The experiment as data: controllers, what the arm has that they do not know, and how a case is run."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surgsim.metrics.accuracy import rms
from surgsim.scenario.load import load_scenario
from surgsim.scenario.schema import Scenario
from surgsim.simulate.loop import simulate
from surgsim.studies.figure import BLACK, BLUE, GREEN, PURPLE, VERMILLION
from surgsim.trace.trace import Trace

Array = NDArray[np.float64]

SCENARIO = "sinusoid_lwr4plus"
TIP_BOUND_MM, RCM_BOUND_MM = 5.0, 15.0
"""What the paper reads off its figures 5 and 6."""

TABLE_I_RATIO = {"vprnn": 0.1 / 10.0, "rnn": 0.01 / 0.01}
"""h0/h1 and c3/c2: the rate at which a resolver climbs the manipulability [rad^2/s]."""


@dataclass(frozen=True, kw_only=True)
class Method:
    """A controller of the comparison.

    Attributes:
        label: Name in tables and figures.
        controller: Shipped controller.
        colour: Colour in figures, of Okabe and Ito.
        style: Line style in figures.
        keys: Assignments that change the controller.
    """

    label: str
    controller: str
    colour: str = BLACK
    style: str = "-"
    keys: tuple[str, ...] = ()


METHODS: dict[str, Method] = {
    "nullspace": Method(label="Nullspace", controller="gradient", colour=VERMILLION, style="--"),
    "rnn": Method(label="RNN", controller="rnn", colour=BLUE, style="-."),
    "vprnn": Method(label="VPRNN", controller="vprnn", colour=PURPLE),
    "rcm_inverse_dynamics": Method(
        label="rcm_inverse_dynamics (ours)", controller="rcm_inverse_dynamics", colour=GREEN
    ),
    "self_motion": Method(
        label="self_motion (ours)",
        controller="self_motion",
        colour="#E69F00",
        style=(0, (5, 1)),  # type: ignore[arg-type]
    ),
}
"""The paper's three controllers, then ours."""

PAPER_METHODS = ("nullspace", "rnn", "vprnn")


@dataclass(frozen=True, kw_only=True)
class Level:
    """What the arm has and the controller's model does not.

    Attributes:
        payload_kg: Mass fixed to the tip adapter [kg].
        coulomb_nm: Dry friction of every joint [N m].
    """

    payload_kg: float = 0.0
    coulomb_nm: float = 0.0

    @property
    def name(self) -> str:
        """In words."""
        if self == NOMINAL:
            return "nominal"
        return f"payload {self.payload_kg:g} kg, friction {self.coulomb_nm:g} N m"

    @property
    def disturbances(self) -> str:
        """The scenario's `disturbances` as YAML."""
        parts = []
        if self.payload_kg:
            parts.append(f"{{type: payload, mass_kg: {self.payload_kg}}}")
        if self.coulomb_nm:
            parts.append(f"{{type: joint_friction, coulomb_nm: {self.coulomb_nm}}}")
        return f"disturbances=[{', '.join(parts)}]"


NOMINAL = Level()
PAPER_SIZE = Level(payload_kg=0.5, coulomb_nm=0.5)
"""Where the errors of VPRNN are of the size of the paper's figures, see `disturbances.py`."""


def scenario(method: Method, level: Level = NOMINAL, keys: Sequence[str] = ()) -> Scenario:
    """The sinusoid with a controller; runs are not stopped for a large RCM error, which is to be seen."""
    return load_scenario(
        SCENARIO,
        controller=method.controller,
        assignments=[
            "theatre=false",
            "safety.rcm_error_max_m=null",
            level.disturbances,
            *method.keys,
            *keys,
        ],
    )


def run_case(method: Method, level: Level = NOMINAL, keys: Sequence[str] = ()) -> Trace:
    """The trace of a case."""
    return simulate(scenario(method, level, keys))


def errors(trace: Trace) -> dict[str, float]:
    """RMS and largest tip and RCM error [mm]."""
    tip, rcm = 1e3 * trace["tip_error_m"], 1e3 * trace["rcm_error_m"]
    return {
        "tip_rms_mm": rms(tip),
        "tip_max_mm": float(tip.max()),
        "rcm_rms_mm": rms(rcm),
        "rcm_max_mm": float(rcm.max()),
    }


def outcome(trace: Trace) -> str:
    """How the run ended."""
    return trace.meta.ending.outcome.name.lower()
