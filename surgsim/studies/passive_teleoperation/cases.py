"""The passive teleoperation paper's numbers, its scenarios, one varied push, and runs where its row acts."""

import json
from dataclasses import dataclass
from itertools import product
from typing import Literal, get_args

from surgsim.catalog import PartConfig
from surgsim.scenario.load import load_scenario
from surgsim.scenario.schema import Scenario
from surgsim.studies.passive_teleoperation.measures import (
    curves_over_time,
    guarded_measures,
    push_measures,
    shipped_measures,
)
from surgsim.studies.study import Curves, Judged, Paper, Printed, SimulatedCase, Verdict
from surgsim.studies.tables import Row, Tables, number, pick
from surgsim.teleop.messages import PassivityMode
from surgsim.trace.trace import Trace

Place = Literal["wall", "free"]
Grip = Literal["normal", "light"]
Link = Literal["clean", "lossy"]
Guardable = Literal["tissue", "throw"]
Guard = Literal["row", "nothing", "valve"]

PAPER = Paper(
    title="A Passive Convex Optimal Control Algorithm for Teleoperating a Redundant Robotic Arm in Minimally "
    "Invasive Surgery",
    reference="doi 10.1002/rnc.7613",
    printed={
        "rcm_rms": Printed("section 3.1", "mm", 0.3),
        "velocity_rms": Printed("section 3.1", "mm/s", 4.7),
        "round_trip": Printed("section 3", "ms", 300),
    },
)

SHIPPED: dict[str, str] = {
    "free motion": "teleop_free_motion_panda",
    "workspace limits": "teleop_workspace_limits_panda",
    "wall, 10 % loss": "teleop_wall_panda",
    "peg and ring": "peg_and_ring_panda",
}
"""The paper's experiment and what it claims, by name."""

ENERGY_TOLERANCE_J = 1e-6
"""What a tank may owe, for rounding."""

_ROW = (
    "controller.resolver.passivity=true",
    "controller.resolver.kinetic=false",
    "controller.torque_law.energy_valve=false",
    "controller.torque_law.press_max_n=null",
)
"""The paper's energy row in place of what the shipped scenarios have: `passive_convex`."""
_GUARDS: dict[Guard, tuple[str, ...]] = {
    "row": _ROW,
    "nothing": (*_ROW[1:], "controller.resolver.passivity=false"),
    "valve": (),
}
_THROW = (
    "task.bilateral.tanks={initial_j: 0.012, target_j: 0.012}",
    "task.goals=[{position_m: [0.0, 0.65, -0.12], push: true, dwell_s: 0.5}]",
    "task.operator={stiffness_n_per_m: 1000.0, damping_ns_per_m: 20.0, reach: "
    "{speed_limit_m_per_s: 0.5, fitts_a_s: 0.0, fitts_b_s: 0.01, shortest_s: 0.1}}",
    "task.mapping.scale=1.0",
    "task.hold_end_s=0.2",
    "props.0.point_m=[0.0, 0.65, -0.05]",
)
"""A hand that goes 90 mm down in a quarter of a second, onto the wall after 20."""

PASSIVITY: tuple[PassivityMode, ...] = ("tank", "tdpa", "off")
GRIPS: tuple[Grip, ...] = ("normal", "light")
DELAYS_MS = (0, 100, 200, 300, 500, 700, 1000)
LOSSY_DELAYS_MS: dict[Grip, tuple[int, ...]] = {"normal": (0, 300, 1000), "light": DELAYS_MS}
LOSSY_SEEDS = (0, 1, 2)
"""Seeds over the lossy channel in a light grip at the paper's delay; the other cells have the first."""

PUSH_S: dict[Grip, float] = {"normal": 6.0, "light": 10.0}
"""A push lasts this and `ROUND_TRIPS`: long enough for a tank to be spent in a light grip [s]."""
ROUND_TRIPS = 4.0

_ASIDE = "{position_m: [0.02, 0.65, -0.045], push: true, dwell_s: 0.1}"
_DOWN = "{position_m: [0.0, 0.65, -0.075], push: true, dwell_s: 1000.0}"
_PUSH = (f"task.goals=[{_ASIDE}, {_DOWN}]", "plant.energy_ledger=false")
_GRIP: dict[Grip, tuple[str, ...]] = {
    "normal": (),
    "light": ("task.operator.stiffness_n_per_m=20.0", "task.operator.damping_ns_per_m=1.0"),
}
_LINK: dict[Link, str] = {"clean": "jitter_s: 0.0, loss: 0.0", "lossy": "jitter_s: 0.01, loss: 0.1"}


@dataclass(frozen=True, kw_only=True)
class Push(SimulatedCase):
    """The operator moves aside, then to 15 mm below the wall's surface, and stays: once, without looking.

    Attributes:
        place: Whether the wall is there.
        passivity: What keeps the channel passive, if anything.
        grip: How firmly the hand holds the handle.
        delay_ms: Round trip; the operator expects it [ms].
        link: Whether the channel has jitter (10 ms) and loss (10 %), each way.
        seed: Of the channel and the operator.
        cut_s: Length of the run if not the whole push [s].
    """

    place: Place
    passivity: PassivityMode
    grip: Grip
    delay_ms: int
    link: Link = "clean"
    seed: int = 0
    cut_s: float | None = None

    @property
    def label(self) -> str:
        """In words."""
        link = "" if self.link == "clean" else f", jitter and loss, seed {self.seed}"
        return f"{self.place}, {self.grip} grip, {self.passivity}, {self.delay_ms} ms{link}"

    @property
    def compared(self) -> bool:
        """Whether it is one of those through the paper's delay that are compared and shown."""
        return self.delay_ms == PAPER["round_trip"] and self.link == "clean"

    @property
    def duration_s(self) -> float:
        """Length of the run [s]."""
        return self.cut_s or round(PUSH_S[self.grip] + ROUND_TRIPS * self.delay_ms / 1000.0, 3)

    def scenario(self) -> Scenario:
        """The shipped wall with this push."""
        delay_s = self.delay_ms / 1000.0
        return load_scenario(
            SHIPPED["wall, 10 % loss"],
            seed=self.seed,
            assignments=[
                "theatre=false",
                *_ROW,
                *_PUSH,
                *_GRIP[self.grip],
                f"task.bilateral.passivity={self.passivity}",
                f"task.duration_s={self.duration_s}",
                f"task.operator.expected_delay_s={delay_s}",
                f"task.channel={{delay_s: {delay_s / 2.0}, {_LINK[self.link]}}}",
                *(("props=[]",) if self.place == "free" else ()),
            ],
        )

    def measures(self, trace: Trace) -> Row:
        """What it is, energy, how it ends, tracking and force feel."""
        names = ("place", "grip", "link", "seed", "delay_ms", "passivity")
        found = push_measures(trace, self.duration_s, tanks=self.passivity == "tank")
        return {**{name: getattr(self, name) for name in names}, **found}

    def curves(self, trace: Trace) -> Curves:
        """Of those that are compared."""
        return curves_over_time(trace) if self.compared else {}


@dataclass(frozen=True)
class Shipped(SimulatedCase):
    """A shipped scenario.

    Attributes:
        name: What the study calls it.
        keys: Assignments that change it.
        real: On real drives, under the controller of ours that is for them: no drive is in the paper's law.
    """

    name: str
    keys: tuple[str, ...] = ()
    real: bool = False

    @property
    def label(self) -> str:
        """In words."""
        return f"{self.name}{', real drives' if self.real else ''}"

    def scenario(self) -> Scenario:
        """The scenario; its theatre, which has no part in it, is left out, and the row is the paper's."""
        keys = ("theatre=false", *(self._on_drives() if self.real else _ROW), *self.keys)
        return load_scenario(SHIPPED[self.name], assignments=keys)

    def _on_drives(self) -> tuple[str, ...]:
        ours = load_scenario(SHIPPED[self.name], controller="passive_elastic").controller
        assert isinstance(ours.torque_law, PartConfig)
        assert isinstance(ours.resolver, PartConfig)
        changed = ours.resolver.model_dump(mode="json", exclude_unset=True, exclude={"type"})
        resolver = (f"controller.resolver.{name}={json.dumps(value)}" for name, value in changed.items())
        law = json.dumps(ours.torque_law.model_dump(mode="json"))
        return "robot.drive=real", f"controller.torque_law={law}", *resolver

    def measures(self, trace: Trace) -> Row:
        """Accuracy, tanks, slack, constraints."""
        return {"scenario": self.name, **shipped_measures(trace)}

    def curves(self, trace: Trace) -> Curves:
        """Everything over time."""
        return curves_over_time(trace)


@dataclass(frozen=True)
class Guarded(SimulatedCase):
    """A run whose remote tank is drawn on, guarded by the paper's row, by the valve, or by nothing.

    Attributes:
        place: Viscous tissue on 0.03 J in each tank, or a hand that throws the tip at the wall on 0.012 J.
        guard: What keeps the tip to the tank's budget.
    """

    place: Guardable
    guard: Guard

    @property
    def label(self) -> str:
        """In words."""
        return f"{self.place}, {self.guard}"

    def scenario(self) -> Scenario:
        """The scenario with this guard."""
        name = "teleop_tissue_panda" if self.place == "tissue" else SHIPPED["wall, 10 % loss"]
        thrown = _THROW if self.place == "throw" else ()
        return load_scenario(name, assignments=["theatre=false", *_GUARDS[self.guard], *thrown])

    def measures(self, trace: Trace) -> Row:
        """Tank, limits, energy."""
        return {"place": self.place, "guard": self.guard, **guarded_measures(trace)}


def comparison(place: Place, delays_ms: tuple[int, ...] = (PAPER["round_trip"],)) -> list[Push]:
    """Every way of keeping passive, in both grips, over a clean channel."""
    return [
        Push(place=place, passivity=passivity, grip=grip, delay_ms=delay)
        for grip, delay, passivity in product(GRIPS, delays_ms, PASSIVITY)
    ]


def guarded() -> list[Guarded]:
    """Where the energy row acts: with it, with the valve, and with neither."""
    return [Guarded(place, guard) for place, guard in product(get_args(Guardable), get_args(Guard))]


def sweep() -> list[Push]:
    """The wall over the delay, clean and lossy."""
    lossy = [
        Push(place="wall", passivity=passivity, grip=grip, delay_ms=delay, link="lossy", seed=seed)
        for grip in GRIPS
        for delay, passivity in product(LOSSY_DELAYS_MS[grip], PASSIVITY)
        for seed in (LOSSY_SEEDS if (grip, delay) == ("light", PAPER["round_trip"]) else LOSSY_SEEDS[:1])
    ]
    return [*comparison("wall", DELAYS_MS), *lossy]


def judge_energy_row(tables: Tables) -> Judged | None:
    """The claim of the energy row, where it acts: it must keep the tank from what it would owe without."""
    rows = tables.get("guarded", ())
    if not rows:
        return None
    owed = {(row["place"], row["guard"]): 1e3 * number(row, "deficit_j") for row in rows}
    places = sorted({str(row["place"]) for row in rows})
    kept = [owed[place, "row"] <= 1e3 * ENERGY_TOLERANCE_J for place in places]
    needed = [owed[place, "nothing"] > 1e3 * ENERGY_TOLERANCE_J for place in places]
    acting = {str(row["place"]): row for row in pick(rows, guard="row")}
    told = "; ".join(
        f"{place}: taken from an empty tank {owed[place, 'nothing']:.3g} mJ without it, "
        f"{owed[place, 'row']:.3g} mJ with it, {owed[place, 'valve']:.3g} mJ with the valve in its place; "
        f"it acts in {number(acting[place], 'acts_percent'):.2g} % of the ticks, the command changing by "
        f"{number(acting[place], 'acceleration_ratio'):.3g} times its limit"
        for place in places
    )
    others = pick(tables["pushes"], passivity="tank")
    acts = sum(number(row, "passivity_percent") > 0.0 for row in others)
    part: Verdict = "depends" if any(kept) or any(needed) else "does not hold"
    return "holds" if all(kept + needed) else part, (
        f"{told}. In the pushes it limits the tip in {acts} of {len(others)}: "
        "there the operator's tank and its refill do the work"
    )
