"""The VPRNN paper's numbers, the controllers, what the arm has that they do not know, and the arm's runs."""

from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from surgsim.metrics.accuracy import rms
from surgsim.metrics.optimality import attainable_manipulability
from surgsim.scenario.load import load_scenario
from surgsim.scenario.schema import Scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare
from surgsim.studies.figure import BLUE, GREEN, ORANGE, PURPLE, VERMILLION
from surgsim.studies.measures import Spread, decay_rate, outcome, within_from_s
from surgsim.studies.study import Curves, Paper, Printed, Results, SimulatedCase
from surgsim.studies.tables import Cell, Row, groups, numbers, pick
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
    """A controller of the comparison: name in tables, shipped controller, colour and style of lines."""

    label: str
    controller: str
    colour: str
    style: Any = "-"


METHODS: dict[str, Method] = {
    "nullspace": Method("Nullspace", "gradient", VERMILLION, "--"),
    "rnn": Method("RNN", "rnn", BLUE, "-."),
    "vprnn": Method("VPRNN", "vprnn", PURPLE),
    "rcm_inverse_dynamics": Method("rcm_inverse_dynamics (ours)", "rcm_inverse_dynamics", GREEN),
    "self_motion": Method("self_motion (ours)", "self_motion", ORANGE, (0, (5, 1))),
}
"""The paper's three controllers, then ours."""
PAPER_METHODS = ("nullspace", "rnn", "vprnn")
LABEL = {name: method.label for name, method in METHODS.items()}


@dataclass(frozen=True)
class Level:
    """What the arm has and the controller's model does not.

    Attributes:
        payload_kg: Mass fixed to the tip adapter [kg].
        coulomb_nm: Dry friction of every joint [N m].
    """

    payload_kg: float = 0.0
    coulomb_nm: float = 0.0

    def __str__(self) -> str:
        """In words."""
        both = f"payload {self.payload_kg:g} kg, friction {self.coulomb_nm:g} N m"
        return "nominal" if self == NOMINAL else both

    @property
    def disturbances(self) -> str:
        """The scenario's `disturbances` as YAML."""
        payload = [f"{{type: payload, mass_kg: {self.payload_kg}}}"] if self.payload_kg else []
        friction = [f"{{type: joint_friction, coulomb_nm: {self.coulomb_nm}}}"] if self.coulomb_nm else []
        return f"disturbances=[{', '.join(payload + friction)}]"


NOMINAL, PAPER_SIZE = Level(), Level(0.5, 0.5)
"""With the second the errors of VPRNN are of the size of the paper's figures, see the ladder."""
LEVELS = (NOMINAL, PAPER_SIZE)
PAYLOADS_KG = (0.0, 0.25, 0.5, 0.75, 1.0)
FRICTIONS_NM = (0.0, 0.25, 0.5, 1.0, 2.0, 5.0)
GRID = tuple(Level(m, f) for m, f in product(PAYLOADS_KG, FRICTIONS_NM))
OURS = tuple(
    level
    for level in GRID
    if 0.0 in (level.payload_kg, level.coulomb_nm) or level in (Level(1.0, 0.5), Level(1.0, 5.0))
)
"""The ladder: VPRNN at every combination, ours at each error alone and at two of the corners."""
SAMPLES = 45
EVERY = 10
"""Rows between points that are drawn of a sinusoid; 10 ms."""
UNMET_M_PER_S = 1e-3


def sinusoid(method: str, level: Level = NOMINAL, keys: tuple[str, ...] = ()) -> Scenario:
    """The sinusoid with a controller; no RCM error stops a run, however far off the skin is passed."""
    stops = ("safety.rcm_error_max_m=null", "safety.stop_at_collision=false")
    fixed = ("theatre=false", *stops, level.disturbances)
    return load_scenario(
        "sinusoid_lwr4plus", controller=METHODS[method].controller, assignments=[*fixed, *keys]
    )


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
        trace = trace.active()
        tip, rcm, mu = 1e3 * trace["tip_error_m"], 1e3 * trace["rcm_error_m"], trace["manipulability"]
        inside = tip.max() <= PAPER["tip_bound"] and rcm.max() <= PAPER["rcm_bound"]
        row: dict[str, Cell] = {
            "level": str(self.level),
            "controller": LABEL[self.method],
            "payload_kg": self.level.payload_kg,
            "friction_nm": self.level.coulomb_nm,
            "outcome": outcome(trace),
            "end_s": trace.meta.ending.t_s,
            **{f"{name}_rms_mm": rms(error) for name, error in (("tip", tip), ("rcm", rcm))},
            **{f"{name}_max_mm": float(error.max()) for name, error in (("tip", tip), ("rcm", rcm))},
            "within_5_and_15_mm": "yes" if inside else "no",
            "mu_mean": float(np.mean(mu)),
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
        plants = ((), ("plant.type=kinematic",)) if self.kinematic else ((),)
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


def integrated(plant: str, form: str) -> Sinusoid:
    """VPRNN with Table I at 1 kHz on a plant, the network integrated in one of two forms."""
    return Sinusoid("vprnn", NOMINAL, (f"plant.type={plant}", f"{_RESOLVER}.integration={form}"))


SPREADS = {"near": Spread(0.015, (5.0, 20.0), (1.0, 10.0)), "far": Spread(0.1, (50.0, 100.0), (10.0, 50.0))}
SEEDS = tuple(range(20))
STARTED = ("nullspace", "rnn", "vprnn", "rcm_inverse_dynamics")
WATCHED_S, SHOWN, LEFT, CONVERGED_MM = 3.0, 8, 0.05, 1.0


@dataclass(frozen=True)
class Start(SimulatedCase):
    """A random initial configuration, the path's start held."""

    method: str
    plant: str
    spread: str
    seed: int

    def scenario(self) -> Scenario:
        """The start held for longer than is watched."""
        keys = (f"task.hold_start_s={WATCHED_S + 1.0}", f"plant.type={self.plant}")
        return sinusoid(self.method, NOMINAL, keys)

    def run(self) -> Trace:
        """The first seconds."""
        setup = prepare(self.scenario())
        simulation = Simulation(replace(setup, q_start=SPREADS[self.spread].draw(setup, self.seed)))
        simulation.advance(round(WATCHED_S / setup.scenario.simulation.control_period_s))
        return simulation.trace()

    def measures(self, trace: Trace) -> Row:
        """Displacement, convergence to 1 mm, equivalent rates."""
        t, done = trace["t_s"], outcome(trace) == "completed"
        found = {"tip": 1e3 * trace["tip_error_m"], "rcm": 1e3 * trace["rcm_error_m"]}
        near = {name: within_from_s(t, e, CONVERGED_MM) for name, e in found.items()}
        return {
            "controller": LABEL[self.method],
            "plant": self.plant,
            "spread": self.spread,
            "seed": self.seed,
            "outcome": outcome(trace),
            **{f"{name}_start_mm": float(e[0]) for name, e in found.items()},
            **{f"{name}_1_mm_from_s": time if done else None for name, time in near.items()},
            **{f"{name}_rate_per_s": decay_rate(t, e, LEFT) if done else None for name, e in found.items()},
            **{f"{name}_end_mm": float(e[-1]) for name, e in found.items()},
        }

    def curves(self, trace: Trace) -> Curves:
        """Both errors of the starts that are shown, every 5 ms."""
        if (self.plant, self.spread) != ("dynamic", "near") or self.seed >= SHOWN:
            return {}
        return {name: trace[name][::5] for name in ("t_s", "tip_error_m", "rcm_error_m")}


_MEDIANS = ("tip_1_mm_from_s", "rcm_1_mm_from_s", "tip_rate_per_s", "rcm_rate_per_s")


def starts_table(results: Results) -> list[Row]:
    """Counts, medians and the slowest of each group; a run that fails is counted, not averaged."""
    table: list[Row] = []
    for key, rows in groups(results.rows("starts"), "plant", "spread", "controller").items():
        values = {name: numbers(rows, name) for name in _MEDIANS}
        both = [row for row in rows if None not in (row["tip_1_mm_from_s"], row["rcm_1_mm_from_s"])]
        counts = {"completed": len(pick(rows, outcome="completed")), "converged": len(both)}
        medians = {f"{name}_median": float(np.median(v)) if v else None for name, v in values.items()}
        slowest = {f"{name}_slowest": max(values[name], default=None) for name in _MEDIANS[:2]}
        named = dict(zip(("plant", "spread", "controller"), key, strict=True))
        table.append({**named, "runs": len(rows), **counts, **medians, **slowest})
    return table
