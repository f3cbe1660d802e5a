"""The VPRNN paper's numbers, the controllers, what the arm has that they do not know, and the arm's runs."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from surgsim.metrics.optimality import attainable_manipulability
from surgsim.scenario.load import load_scenario
from surgsim.scenario.schema import Scenario
from surgsim.studies.figure import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILLION
from surgsim.studies.levels import NOMINAL, Drive, Ladder, Level
from surgsim.studies.measures import tracking
from surgsim.studies.stages import LedThenTracking
from surgsim.studies.starts import RandomStart, Spread
from surgsim.studies.study import Curves, Paper, Printed, Results, SimulatedCase
from surgsim.studies.tables import Cell, Row, number
from surgsim.trace.trace import Trace

PAPER = Paper(
    title="Varying parameters recurrent neural network (VPRNN) based hierarchical control of a 7-DoF "
    "surgical manipulator for robot-assisted minimally invasive surgery",
    printed={
        "tip_bound": Printed("figure 5", "mm", 5.0),
        "rcm_bound": Printed("figure 6", "mm", 15.0),
        "climbing_rate": Printed("Table I", "rad^2/s", {"vprnn": 0.1 / 10.0, "rnn": 0.01 / 0.01}),
    },
)
"""The climbing rate of a resolver on the manipulability is h0/h1 or c3/c2."""


class Method(NamedTuple):
    """A controller: name in tables, shipped controller, colour and style of lines, what is changed of it."""

    label: str
    controller: str
    colour: str = BLACK
    style: Any = "-"
    keys: tuple[str, ...] = ()


METHODS: dict[str, Method] = {
    "nullspace": Method("Nullspace", "gradient", VERMILLION, "--"),
    "rnn": Method("RNN", "rnn", BLUE, "-."),
    "vprnn": Method("VPRNN", "vprnn", PURPLE),
    **{
        name: Method(f"{name} (ours)", name, GREEN)
        for name in ("rcm_inverse_dynamics", "rcm_elastic_dynamics")
    },
    "self_motion": Method("self_motion (ours)", "self_motion", ORANGE, (0, (5, 1))),
    "rnn_tip": Method("RNN without RCM rows", "rnn", keys=("controller.resolver.rcm=false",)),
    **{name: Method(name, name) for name in ("pinv", "qp", "mink")},
}
PAPER_METHODS = ("nullspace", "rnn", "vprnn")
COMPARED = (*PAPER_METHODS, "rcm_inverse_dynamics", "self_motion")
"""In figures 4 to 8: the paper's three controllers, then ours."""
LABEL = {name: method.label for name, method in METHODS.items()}


PAPER_SIZE = Level(0.5, 0.5)
"""With the second the errors of VPRNN are of the size of the paper's figures, see the ladder."""
LEVELS = (NOMINAL, PAPER_SIZE)
PAYLOADS_KG = (0.0, 0.25, 0.5, 0.75, 1.0)
_LADDERS: tuple[tuple[str, str, Drive, tuple[float, ...]], ...] = (
    ("rcm_inverse_dynamics", "ladder", "ideal", (0.0, 0.25, 0.5, 1.0, 2.0, 5.0)),
    ("rcm_elastic_dynamics", "ladder_real", "real", (0.0, 2.0, 4.0, 8.0, 12.0)),
)
LADDERS = {
    ours: Ladder(table, drive, PAYLOADS_KG, frictions, LABEL["vprnn"], LABEL[ours])
    for ours, table, drive, frictions in _LADDERS
}
"""By the controller of ours that stands beside VPRNN; friction up to what an LWR4+ was found to have."""
ERRORS = ("tip_rms_mm", "tip_max_mm", "rcm_rms_mm", "rcm_max_mm")
SAMPLES = 45
EVERY = 10
"""Rows between points that are drawn of a sinusoid; 10 ms."""
UNMET_M_PER_S = 1e-3


_FIXED = ("theatre=false", "safety.rcm_error_max_m=null", "safety.stop_at_collision=false")


def sinusoid(method: str, level: Level = NOMINAL, keys: tuple[str, ...] = ()) -> Scenario:
    """The sinusoid with a controller; no RCM error stops a run, however far off the skin is passed."""
    found = METHODS[method]
    assignments = (*_FIXED, *level.assignments, *found.keys, *keys)
    return load_scenario("sinusoid_lwr4plus", controller=found.controller, assignments=assignments)


@dataclass(frozen=True)
class Sinusoid(SimulatedCase):
    """A controller on the sinusoid at a level of disturbance, with some of its settings changed.

    Figures 4 to 8 show those at one of `LEVELS` with nothing changed.
    """

    method: str
    level: Level = NOMINAL
    keys: tuple[str, ...] = ()

    @property
    def _shown(self) -> bool:
        return self.level in LEVELS and not self.keys

    def scenario(self) -> Scenario:
        """The shipped sinusoid."""
        return sinusoid(self.method, self.level, self.keys)

    def measures(self, trace: Trace) -> Row:
        """The disturbance, errors, mu, and when the network's rows are no longer met; until a stop.

        The share of mu is of what self-motion could reach at the run's own tip.
        """
        found, trace = tracking(trace), trace.active()
        mu, largest = trace["manipulability"], (number(found, "tip_max_mm"), number(found, "rcm_max_mm"))
        inside = largest[0] <= PAPER["tip_bound"] and largest[1] <= PAPER["rcm_bound"]
        row: dict[str, Cell] = {
            "level": str(self.level),
            "controller": LABEL[self.method],
            "payload_kg": self.level.payload_kg,
            "friction_nm": self.level.coulomb_nm,
            **found,
            "duration_s": float(trace.meta.scenario["task"]["duration_s"]),
            "torque_law": trace.meta.scenario["controller"]["torque_law"]["type"],
            "evaluated_at": trace.meta.scenario["controller"]["evaluate_at"],
            "within_5_and_15_mm": "yes" if inside else "no",
            "mu_end": float(mu[-1]),
        }
        if self._shown:
            rows, best = attainable_manipulability(trace, SAMPLES)
            row["mu_over_attainable"] = float(np.mean(mu[rows] / best))
        if self.method == "vprnn":
            unmet = trace["t_s"][trace["resolver_residual_m_per_s"] > UNMET_M_PER_S]
            row["rows_unmet_from_s"] = min(map(float, unmet[unmet > 0.1]), default=None)
            plant, resolver = trace.meta.scenario["plant"], trace.meta.scenario["controller"]["resolver"]
            row |= {"plant": plant["type"], "integration": resolver["integration"]}
        return row

    def curves(self, trace: Trace) -> Curves:
        """What figures 4 to 8 show, every 10 ms, with the whole path of the tip, and mu* at its samples."""
        if not self._shown:
            return {}
        rows, best = attainable_manipulability(trace, SAMPLES)
        columns = ("t_s", "tip_error_m", "rcm_error_m", "manipulability")
        return {
            **{name: trace[name][::EVERY] for name in columns},
            "q": trace.block("q")[::EVERY],
            **{name: trace.block(name) for name in ("tip", "tip_ref")},
            "attainable_t_s": trace["t_s"][rows],
            "attainable": best,
        }


KINEMATIC = ("plant.type=kinematic",)


class Gains(NamedTuple):
    """Changed gains, run under torques and where `kinematic` also with perfect velocity tracking.

    The rate is the resolver's climbing rate: h0/h1, c3/c2 or the null-space gain [rad^2/s].
    """

    variant: str
    rate: float | None
    method: str
    keys: tuple[str, ...] = ()
    kinematic: bool = True
    quick: bool = False

    @property
    def cases(self) -> list[Sinusoid]:
        """The runs."""
        plants = ((), KINEMATIC) if self.kinematic else ((),)
        return [Sinusoid(self.method, NOMINAL, (*self.keys, *plant)) for plant in plants]


GAIN = 1.0
"""Of the shipped controller `gradient` [rad^2/s]."""
_NOTES = {0.0: ", no climbing", GAIN: " (used here)"}
_LAW, _RESOLVER = "controller.torque_law", "controller.resolver"
_JOINT_GAINS = ("joint_stiffness_nm_per_rad", "joint_damping_nm_s_per_rad")
_CUT_OFF = tuple(f"{_LAW}.{name}=[0,0,0,0,0,0,0]" for name in _JOINT_GAINS)


def _nullspace(gain: float) -> Gains:
    keys = () if gain == GAIN else (f"{_RESOLVER}.gain_rad2_per_s={gain}",)
    name = f"Nullspace, gain {gain:g}{_NOTES.get(gain, '')}"
    return Gains(name, gain, "nullspace", keys, quick=gain in _NOTES)


VARIANTS = (
    *(_nullspace(gain) for gain in (0.0, 0.01, 0.1, 1.0, 10.0)),
    Gains("RNN, Table I", 1.0, "rnn", quick=True),
    Gains("RNN, Table I, without RCM rows", 1.0, "rnn", (f"{_RESOLVER}.rcm=false",), kinematic=False),
    Gains("VPRNN, Table I", 0.01, "vprnn", quick=True),
    Gains("VPRNN, h0/h1 = 1", 1.0, "vprnn", (f"{_RESOLVER}.h0=10.0",)),
    Gains("VPRNN, h0/h1 = 10", 10.0, "vprnn", (f"{_RESOLVER}.h0=100.0",)),
    Gains("VPRNN, Table I, K_N2 = D_N2 = 0", None, "vprnn", _CUT_OFF, kinematic=False, quick=True),
)


def gains_table(results: Results) -> list[Row]:
    """Every variant under torques, and where it makes sense with perfect velocity tracking."""
    rows: list[Row] = []
    for gains in (gains for gains in VARIANTS if gains.cases[0] in results):
        torques, *kinematic = [results.of(case) for case in gains.cases]
        named = {"variant": gains.variant, "climbing_rate": gains.rate}
        ideal = {"mu_mean_kinematic": kinematic[0].row["mu_mean"] if kinematic else None}
        rows.append({**named, **torques.only(*ERRORS, "mu_mean"), **ideal})
    return rows


def integrated(plant: str, form: str) -> Sinusoid:
    """VPRNN with Table I at 1 kHz on a plant, the network integrated in one of two forms."""
    return Sinusoid("vprnn", NOMINAL, (f"plant.type={plant}", f"{_RESOLVER}.integration={form}"))


SPREADS = {"near": Spread(0.015, (5.0, 20.0), (1.0, 10.0)), "far": Spread(0.1, (50.0, 100.0), (10.0, 50.0))}
STARTED = ("nullspace", "rnn", "vprnn", "rcm_inverse_dynamics")
WATCHED_S, SHOWN = RandomStart.watched_s, 8


@dataclass(frozen=True)
class Start(RandomStart):
    """A random initial configuration, the path's start held."""

    spreads, names = SPREADS, LABEL

    def scenario(self) -> Scenario:
        """The start held for longer than is watched."""
        keys = (f"task.hold_start_s={WATCHED_S + 1.0}", f"plant.type={self.plant}")
        return sinusoid(self.method, NOMINAL, keys)

    def curves(self, trace: Trace) -> Curves:
        """Both errors of the starts that are shown, every 5 ms."""
        if (self.plant, self.spread) != ("dynamic", "near") or self.seed >= SHOWN:
            return {}
        return {name: trace[name][::5] for name in ("t_s", "tip_error_m", "rcm_error_m")}


DURATIONS_S = (10.0, 4.0, 2.0)
"""Of the sinusoid: this study's, and faster ones; the paper gives none."""
RESOLVED = ("vprnn", "rnn", "rnn_tip", "nullspace", "pinv", "qp", "mink", "self_motion")


class Law(NamedTuple):
    """A torque law with its shipped gains, and where the resolver above it is evaluated."""

    name: str
    at: str = "measured"


LAWS = (
    Law("hierarchical_impedance"),
    *(
        Law(name, at)
        for name in ("joint_impedance", "joint_elastic_dynamics")
        for at in ("reference", "measured")
    ),
    *map(Law, ("projected_jacobian", "null_space_basis", "constraint_consistent")),
    *map(Law, ("rcm_inverse_dynamics", "rcm_elastic_dynamics", "rcm_mpc")),
)
LAW_DURATIONS_S = DURATIONS_S[:2]


def resolved(method: str, duration_s: float, law: Law | None = None) -> Sinusoid:
    """A resolver along the sinusoid over a torque law, or on the kinematic plant."""
    over: tuple[str, ...] = KINEMATIC
    if law is not None:
        over = (f"{_LAW}={{type: {law.name}}}", f"controller.evaluate_at={law.at}")
    return Sinusoid(method, NOMINAL, (f"task.duration_s={duration_s:g}", *over))


@dataclass(frozen=True)
class Inserted(LedThenTracking):
    """A hand leads the instrument through the port, then the tip goes to the sinusoid and follows it."""

    method: str

    @property
    def name(self) -> str:
        """The controller."""
        return LABEL[self.method]

    def stages(self) -> tuple[Scenario, Scenario]:
        """The shipped insertion, its target the start of the path, and the shipped sinusoid.

        A disturbance observer would hold against the hand: `rcm_inverse_dynamics` is led as the shipped
        insertion has it, without.
        """
        tracked = sinusoid(self.method)
        held = tracked.model_dump()
        path, port = held["task"]["start_m"], held["trocar"]["position_m"]
        target = [round(a - b, 9) for a, b in zip(path, port, strict=True)]
        keys = (*_FIXED, f"task.target_from_port_m={target}", "task.duration_s=20")
        named = None if self.method == "rcm_inverse_dynamics" else METHODS[self.method].controller
        return load_scenario("hands_on_insertion_lwr4plus", controller=named, assignments=keys), tracked
