"""One push by every bilateral scheme, over delay, loss, jitter, grip and what is pushed on."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from surgsim.array import Array
from surgsim.metrics.accuracy import rms
from surgsim.metrics.catalog import compute_metrics
from surgsim.scenario.load import load_scenario
from surgsim.scenario.schema import Scenario
from surgsim.studies.measures import outcome
from surgsim.studies.study import Paper, SimulatedCase
from surgsim.studies.tables import Cell, Row, number
from surgsim.teleop.judgement import PASSIVE_J, excess_j
from surgsim.trace.trace import Trace

Grip = Literal["normal", "light"]

PAPER = Paper(
    title="Experimental Comparison Study of Control Architectures for Bilateral Teleoperators",
    reference="Rodriguez-Seda, Lee, Spong, IEEE Trans. Robot. 25(6), 2009",
    printed={},
)

SCHEMES: dict[str, str] = {
    "passive convex, tank": "{type: passive_convex, passivity: tank}",
    "passive convex, tdpa": "{type: passive_convex, passivity: tdpa}",
    "passive convex, off": "{type: passive_convex, passivity: off}",
    "position-position": "{type: position_position}",
    "position-force": "{type: position_force}",
    "four-channel": "{type: four_channel}",
    "P+d": "{type: p_plus_d}",
    "set-position": "{type: passive_set_position}",
    "two-layer": "{type: two_layer}",
    "waves": "{type: wave_variables}",
    "time-domain": "{type: time_domain}",
}
"""What a scheme is called here, and `task.bilateral`."""
_AS_THE_OTHERS = ("task.bilateral.stiffness_n_per_m=240.0",)
COUPLED = {"waves": _AS_THE_OTHERS, "time-domain": _AS_THE_OTHERS}
"""Whose coupling is stiffer than the others' by default, 500 N/m, and made equal for the Z-width."""
MADE_PASSIVE = (
    "passive convex, tank",
    "passive convex, tdpa",
    "P+d",
    "set-position",
    "two-layer",
    "waves",
    "time-domain",
)
"""Schemes with something that is to keep them passive."""
DELAYS_MS = (0, 100, 300, 600, 1000)
NETWORKS = ((0.0, 0), (0.2, 0), (0.5, 0), (0.0, 20), (0.5, 20))
"""Share of packets that are lost, and standard deviation of the delay [ms], each way."""
GRIPS: tuple[Grip, ...] = ("normal", "light")
_SURFACE = "point_m: [0.0, 0.65, -0.06]"
SURROUNDINGS: dict[str, tuple[str, str]] = {
    "wall": (
        f"[{{type: contact_wall, {_SURFACE}, stiffness_n_per_m: 20000.0, damping_n_s_per_m: 100.0}}]",
        "[]",
    ),
    "tissue": ("[]", f"[{{type: tissue, {_SURFACE}, stiffness_n_per_m: 200.0}}]"),
}
"""What is pushed on: `props` and `disturbances`."""
SEEDS = (0, 1, 2)

PUSH_S, ROUND_TRIPS, WINDOW_S = 6.0, 4.0, 2.0
REST_MM_PER_S, STEADY_N, STEADY_SHARE = 5.0, 0.5, 0.05
"""A push rests: handle slower than this (RMS), and the force's deviation below this or this share of it."""
DEPTHS_M, HOLD_S, HOLD_ROUND_TRIPS, MOVES_S = (-0.065, -0.08), 2.5, 2.0, 2.0
"""Where the hand goes to be shown an impedance, how long it holds there, and what the moves take."""
_LIGHT = ("task.operator.stiffness_n_per_m=20.0", "task.operator.damping_ns_per_m=1.0")
_ASIDE = "{{position_m: [0.02, 0.65, -0.045], push: true, dwell_s: {dwell_s}}}"
SEEN_S = 0.5
"""The hand waits for this beyond the round trip before it pushes: it aims by what it sees of the tip."""
_DOWN = "{position_m: [0.0, 0.65, -0.075], push: true, dwell_s: 1000.0}"
_LEAST_N = 0.1


@dataclass(frozen=True, kw_only=True)
class Push(SimulatedCase):
    """The hand moves aside, then to 15 mm below the surface, and stays: once, without looking.

    Attributes:
        scheme: One of `SCHEMES`.
        surroundings: What is pushed on, one of `SURROUNDINGS`.
        grip: How firmly the hand holds the handle.
        delay_ms: Round trip; the operator expects it [ms].
        loss: Share of packets lost, each way.
        jitter_ms: Standard deviation of the delay each way, beyond `delay_ms` [ms].
        seed: Of operator and channels.
        cut_s: Length of the run if not the whole push [s].
    """

    scheme: str
    surroundings: str = "wall"
    grip: Grip
    delay_ms: int
    loss: float
    jitter_ms: int = 0
    seed: int = 0
    cut_s: float | None = None

    @property
    def label(self) -> str:
        """In words."""
        line = f"{self.delay_ms} ms, loss {self.loss:g}, jitter {self.jitter_ms} ms"
        return f"{self.scheme}, {self.surroundings}, {self.grip} grip, {line}, seed {self.seed}"

    @property
    def duration_s(self) -> float:
        """Length of the run [s]."""
        return self.cut_s or round(PUSH_S + ROUND_TRIPS * self.delay_ms / 1000.0, 3)

    def scenario(self) -> Scenario:
        """The shipped push with this scheme, these surroundings and this channel."""
        props, disturbances = SURROUNDINGS[self.surroundings]
        aside = _ASIDE.format(dwell_s=round(SEEN_S + self.delay_ms / 1000.0, 3))
        return _teleoperated(
            self,
            f"props={props}",
            f"disturbances={disturbances}",
            f"task.goals=[{aside}, {_DOWN}]",
            f"task.channel={_line(self.delay_ms, self.jitter_ms, self.loss)}",
            *(_LIGHT if self.grip == "light" else ()),
        )

    def measures(self, trace: Trace) -> Row:
        """What it is, energy, whether it rests, and what the hand feels of the contact."""
        names = ("scheme", "surroundings", "grip", "loss", "jitter_ms", "delay_ms", "seed")
        return {**{name: getattr(self, name) for name in names}, **push_measures(trace.active())}


def push_measures(trace: Trace) -> Row:
    """Energy, rest and transparency of a push, over its last two seconds.

    `mismatch` is how far the force on the hand, in the tip's scale, is from that on the tip, over the latter.
    """
    scale = float(trace.meta.scenario["task"]["mapping"]["scale"])
    last = trace["t_s"] >= trace["t_s"][-1] - WINDOW_S
    contact, felt = (_size(trace, name)[last] for name in ("tip_force", "master_force"))
    speed = 1e3 * rms(_size(trace, "handle_velocity")[last])
    force, deviation, found = float(contact.mean()), float(contact.std()), compute_metrics(trace)
    steady = deviation <= max(STEADY_N, STEADY_SHARE * force)
    excess = excess_j(trace)
    return {
        "outcome": outcome(trace),
        "rests": float(outcome(trace) == "completed" and speed <= REST_MM_PER_S and steady),
        "passive": float(excess <= PASSIVE_J),
        "excess_j": excess,
        "handle_speed_mm_per_s": speed,
        "contact_force_n": force,
        "contact_deviation_n": deviation,
        "contact_max_n": found["tip_force_max_n"],
        "hand_force_n": float(felt.mean()),
        "mismatch": abs(float(felt.mean()) / scale - force) / force if force > _LEAST_N else None,
        "stiffness_n_per_m": found["transmitted_stiffness_n_per_m"],
        "drift_mm": found["drift_end_mm"],
        "rcm_max_mm": found["rcm_error_max_mm"],
    }


@dataclass(frozen=True, kw_only=True)
class Render(SimulatedCase):
    """The hand goes to 5 mm and then to 20 mm below a surface, and holds at both: of a wall, or of nothing.

    What it feels in free motion and on the wall are the ends of the impedances that a scheme renders.

    Attributes:
        scheme: One of `SCHEMES`.
        wall: Whether there is one.
        delay_ms: Round trip; the operator expects it [ms].
        seed: Of operator and channels.
    """

    scheme: str
    wall: bool
    delay_ms: int
    seed: int = 0

    @property
    def label(self) -> str:
        """In words."""
        return (
            f"{self.scheme}, {'wall' if self.wall else 'free motion'}, {self.delay_ms} ms, seed {self.seed}"
        )

    @property
    def dwell_s(self) -> float:
        """How long it holds at either depth [s]."""
        return round(HOLD_S + HOLD_ROUND_TRIPS * self.delay_ms / 1000.0, 3)

    @property
    def duration_s(self) -> float:
        """Length of the run [s]."""
        return round(2.0 * self.dwell_s + MOVES_S, 3)

    def scenario(self) -> Scenario:
        """The shipped push in a normal grip, through a clean line."""
        goals = [f"{{position_m: [0.0, 0.65, {z}], push: true, dwell_s: {self.dwell_s}}}" for z in DEPTHS_M]
        props, _ = SURROUNDINGS["wall"]
        return _teleoperated(
            self,
            f"props={props if self.wall else '[]'}",
            f"task.goals=[{', '.join(goals)}]",
            f"task.channel={_line(self.delay_ms)}",
            *COUPLED.get(self.scheme, ()),
        )

    def measures(self, trace: Trace) -> Row:
        """What it is, energy, and the impedance that the hand feels."""
        names = ("scheme", "wall", "delay_ms", "seed")
        return {**{name: getattr(self, name) for name in names}, **render_measures(trace.active())}


def render_measures(trace: Trace) -> Row:
    """Energy, rest, and what the motors of the console render.

    `damping_ns_per_m` is the power that they take from the handle over its speed's square, and
    `impedance_ns_per_m` their force over its speed, both by RMS over the run. `stiffness_n_per_m` is the
    change of their force along the handle's way between the ends of both holds, over that way; there is none
    unless the tip touches and everything is at rest at both.
    """
    force, velocity, handle = (trace.block(name) for name in ("master_force", "handle_velocity", "handle"))
    goal, t, excess = trace["goal"], trace["t_s"], excess_j(trace)
    holds = [
        (goal == k) & (t >= t[goal == k][-1] - WINDOW_S / 2.0)
        for k in range(len(DEPTHS_M))
        if (goal == k).any()
    ]
    touched = _size(trace, "tip_force") if "tip_force" in trace else np.zeros(len(trace))
    touch = [touched[hold] for hold in holds]
    row: dict[str, Cell] = {
        "outcome": outcome(trace),
        "passive": float(excess <= PASSIVE_J),
        "excess_j": excess,
        "damping_ns_per_m": -float((force * velocity).sum() / (velocity**2).sum()),
        "impedance_ns_per_m": rms(_size(trace, "master_force")) / rms(_size(trace, "handle_velocity")),
        "stiffness_n_per_m": None,
        "contact_force_n": float(touch[-1].mean()),
        "handle_speed_mm_per_s": 1e3 * max(rms(np.linalg.norm(velocity[hold], axis=1)) for hold in holds),
    }
    steady = all(n.mean() > _LEAST_N and n.std() <= max(_LEAST_N, STEADY_SHARE * n.mean()) for n in touch)
    if len(holds) == len(DEPTHS_M) and steady and number(row, "handle_speed_mm_per_s") <= REST_MM_PER_S:
        way, change = (a[holds[1]].mean(axis=0) - a[holds[0]].mean(axis=0) for a in (handle, force))
        row["stiffness_n_per_m"] = -float(change @ way) / float(way @ way)
    return row


def _teleoperated(case: "Push | Render", *assignments: str) -> Scenario:
    """The shipped wall with the scheme, seed and length of a case, and these changes."""
    own = (f"task.bilateral={SCHEMES[case.scheme]}", f"task.duration_s={case.duration_s}")
    fixed = ("theatre=false", "plant.energy_ledger=false")
    return load_scenario("teleop_wall_panda", seed=case.seed, assignments=(*fixed, *own, *assignments))


def _line(delay_ms: int, jitter_ms: int = 0, loss: float = 0.0) -> str:
    """The channel of a round trip, the same each way."""
    return f"{{delay_s: {delay_ms / 2000.0}, jitter_s: {jitter_ms / 1000.0}, loss: {loss}}}"


def _size(trace: Trace, block: str) -> Array:
    """Length of a vector at every tick (rows,)."""
    return np.asarray(np.linalg.norm(trace.block(block), axis=1))


def pushes() -> Sequence[Push]:
    """Every cell of the map, with every seed."""
    return [
        Push(
            scheme=scheme,
            surroundings=surroundings,
            grip=grip,
            delay_ms=delay,
            loss=loss,
            jitter_ms=jitter,
            seed=seed,
        )
        for scheme, surroundings, grip, (loss, jitter), delay, seed in product(
            SCHEMES, SURROUNDINGS, GRIPS, NETWORKS, DELAYS_MS, SEEDS
        )
    ]


def renders() -> Sequence[Render]:
    """Free motion and the wall by every scheme, at every delay, with every seed."""
    return [
        Render(scheme=scheme, wall=wall, delay_ms=delay, seed=seed)
        for scheme, wall, delay, seed in product(SCHEMES, (False, True), DELAYS_MS, SEEDS)
    ]
