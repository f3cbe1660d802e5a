"""The experiment as data: the paper's scenarios as shipped, and one push that is varied."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

from surgsim.scenario.load import load_scenario
from surgsim.scenario.schema import Scenario
from surgsim.studies.figure import BLUE, GREEN, VERMILLION
from surgsim.teleop.messages import PassivityMode

Place = Literal["wall", "free"]
Grip = Literal["normal", "light"]
Link = Literal["clean", "lossy"]

SHIPPED: dict[str, str] = {
    "free motion": "teleop_free_motion_panda",
    "workspace limits": "teleop_workspace_limits_panda",
    "wall, 10 % loss": "teleop_wall_panda",
    "peg and ring": "peg_and_ring_panda",
}
"""The paper's experiment and what it claims, by name."""

PASSIVITY: tuple[PassivityMode, ...] = ("tank", "tdpa", "off")
COLOURS = {"tank": BLUE, "tdpa": GREEN, "off": VERMILLION}
GRIPS: tuple[Grip, ...] = ("normal", "light")
DELAYS_MS = (0, 100, 200, 300, 500, 700, 1000)
LOSSY_DELAYS_MS: dict[Grip, tuple[int, ...]] = {"normal": (0, 300, 1000), "light": DELAYS_MS}
LOSSY_SEEDS = (0, 1, 2)
"""Seeds over the lossy channel in a light grip at the paper's delay; the other cells have the first."""

PAPER_DELAY_MS = 300

PUSH_S: dict[Grip, float] = {"normal": 6.0, "light": 10.0}
"""A push lasts this and `ROUND_TRIPS`: long enough for a tank to be spent in a light grip [s]."""
ROUND_TRIPS, WINDOW_S = 4.0, 2.0
"""The last two windows, in which the intention rests, are compared."""


_ASIDE = "{position_m: [0.02, 0.65, -0.045], push: true, dwell_s: 0.1}"
_DOWN = "{position_m: [0.0, 0.65, -0.075], push: true, dwell_s: 1000.0}"
_PUSH = (f"task.goals=[{_ASIDE}, {_DOWN}]", "plant.energy_ledger=false")
_GRIP: dict[Grip, tuple[str, ...]] = {
    "normal": (),
    "light": ("task.operator.stiffness_n_per_m=20.0", "task.operator.damping_ns_per_m=1.0"),
}
_LINK: dict[Link, str] = {"clean": "jitter_s: 0.0, loss: 0.0", "lossy": "jitter_s: 0.01, loss: 0.1"}


@dataclass(frozen=True, kw_only=True)
class Push:
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
                *_PUSH,
                *_GRIP[self.grip],
                f"task.passivity={self.passivity}",
                f"task.duration_s={self.duration_s}",
                f"task.operator.expected_delay_s={delay_s}",
                f"task.channel={{delay_s: {delay_s / 2.0}, {_LINK[self.link]}}}",
                *(("props=[]",) if self.place == "free" else ()),
            ],
        )


@dataclass(frozen=True, kw_only=True)
class Shipped:
    """A shipped scenario.

    Attributes:
        name: What the study calls it.
        keys: Assignments that change it.
    """

    name: str
    keys: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """In words."""
        return self.name

    def scenario(self) -> Scenario:
        """The scenario; nothing but its theatre, which has no part in it, is left out."""
        return load_scenario(SHIPPED[self.name], assignments=["theatre=false", *self.keys])


Case = Push | Shipped


def comparison(place: Place, delays_ms: Sequence[int] = (PAPER_DELAY_MS,)) -> list[Push]:
    """Every way of keeping passive, in both grips, over a clean channel."""
    return [
        Push(place=place, passivity=passivity, grip=grip, delay_ms=delay)
        for grip, delay, passivity in product(GRIPS, delays_ms, PASSIVITY)
    ]


def sweep() -> list[Push]:
    """The wall over the delay, clean and lossy."""
    lossy = [
        Push(place="wall", passivity=passivity, grip=grip, delay_ms=delay, link="lossy", seed=seed)
        for grip in GRIPS
        for delay, passivity in product(LOSSY_DELAYS_MS[grip], PASSIVITY)
        for seed in (LOSSY_SEEDS if (grip, delay) == ("light", PAPER_DELAY_MS) else LOSSY_SEEDS[:1])
    ]
    return [*comparison("wall", DELAYS_MS), *lossy]
