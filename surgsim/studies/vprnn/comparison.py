"""Figures 4 to 8: the controllers on the same path, and what their gains change."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from surgsim.metrics.optimality import attainable_manipulability
from surgsim.studies.study import Progress, Row
from surgsim.studies.vprnn.cases import METHODS, NOMINAL, Level, Method, errors, outcome, run_case
from surgsim.trace.trace import Trace

Array = NDArray[np.float64]
Runs = Mapping[tuple[str, Level], Trace]
SAMPLES = 45
GAIN = 1.0
"""Of the shipped controller `gradient` [rad^2/s]."""

_LAW = "controller.torque_law"
DISCONNECTED = (
    f"{_LAW}.joint_stiffness_nm_per_rad=[0,0,0,0,0,0,0]",
    f"{_LAW}.joint_damping_nm_s_per_rad=[0,0,0,0,0,0,0]",
)
KINEMATIC = ("plant.type=kinematic",)


@dataclass(frozen=True, kw_only=True)
class Variant:
    """A run of the gain table.

    Attributes:
        label: What was changed.
        rate: Climbing rate of the resolver, h0/h1, c3/c2 or the null-space gain [rad^2/s]; None if none acts.
        method: Key of the controller that was changed.
        keys: The changes.
        kinematic: Whether it also makes sense on the kinematic plant.
        quick: Whether a quick study has it.
    """

    label: str
    rate: float | None
    method: str
    keys: tuple[str, ...] = ()
    kinematic: bool = True
    quick: bool = False


def _nullspace(gain: float) -> Variant:
    note = {0.0: ", no climbing", GAIN: " (used here)"}.get(gain, "")
    return Variant(
        label=f"Nullspace, gain {gain:g}{note}",
        rate=gain,
        method="nullspace",
        keys=() if gain == GAIN else (f"controller.resolver.gain_rad2_per_s={gain}",),
        quick=gain in (0.0, GAIN),
    )


VARIANTS = (
    *(_nullspace(gain) for gain in (0.0, 0.01, 0.1, 1.0, 10.0)),
    Variant(label="RNN, Table I", rate=1.0, method="rnn", quick=True),
    Variant(
        label="RNN, Table I, without RCM rows",
        rate=1.0,
        method="rnn",
        keys=("controller.resolver.rcm=false",),
        kinematic=False,
    ),
    Variant(label="VPRNN, Table I", rate=0.01, method="vprnn", quick=True),
    Variant(label="VPRNN, h0/h1 = 1", rate=1.0, method="vprnn", keys=("controller.resolver.h0=10.0",)),
    Variant(label="VPRNN, h0/h1 = 10", rate=10.0, method="vprnn", keys=("controller.resolver.h0=100.0",)),
    Variant(
        label="VPRNN, Table I, K_N2 = D_N2 = 0",
        rate=None,
        method="vprnn",
        keys=DISCONNECTED,
        kinematic=False,
        quick=True,
    ),
)


def run_all(methods: Iterable[str], levels: Iterable[Level], progress: Progress) -> Runs:
    """A run for every controller at every level."""
    runs = {}
    for level in levels:
        for name in methods:
            progress(f"sinusoid, {level.name}: {METHODS[name].label}")
            runs[name, level] = run_case(METHODS[name], level)
    return runs


def attainable(trace: Trace) -> tuple[Array, Array]:
    """Time [s] and the largest manipulability that self-motion could reach there, each (samples,)."""
    rows, best = attainable_manipulability(trace, SAMPLES)
    return trace["t_s"][rows], best


def comparison_row(name: str, level: Level, trace: Trace) -> Row:
    """One controller at one level; the share of mu is of what self-motion could reach at its own tip."""
    rows, best = attainable_manipulability(trace, SAMPLES)
    mu = trace["manipulability"]
    return {
        "level": level.name,
        "controller": METHODS[name].label,
        "outcome": outcome(trace),
        **errors(trace),
        "mu_mean": float(np.mean(mu)),
        "mu_end": float(mu[-1]),
        "mu_over_attainable": float(np.mean(mu[rows] / best)),
    }


def comparison_table(runs: Runs) -> list[Row]:
    """Every run."""
    return [comparison_row(name, level, trace) for (name, level), trace in runs.items()]


def variant_row(variant: Variant, runs: Runs) -> Row:
    """A variant under torques and, where it makes sense, with perfect velocity tracking.

    One that changes nothing is taken from `runs` if it is there.
    """
    base, key = METHODS[variant.method], (variant.method, NOMINAL)
    method = replace(base, keys=(*base.keys, *variant.keys))
    trace = runs[key] if key in runs and not variant.keys else run_case(method, NOMINAL)
    ideal = _kinematic_mu(method) if variant.kinematic else None
    return {
        "variant": variant.label,
        "climbing_rate": variant.rate,
        **errors(trace),
        "mu_mean": float(np.mean(trace["manipulability"])),
        "mu_mean_kinematic": ideal,
    }


def _kinematic_mu(method: Method) -> float:
    return float(np.mean(run_case(method, NOMINAL, KINEMATIC)["manipulability"]))


def variant_table(variants: Iterable[Variant], runs: Runs, progress: Progress) -> list[Row]:
    """Every variant, nominal."""
    rows = []
    for variant in variants:
        progress(f"gains: {variant.label}")
        rows.append(variant_row(variant, runs))
    return rows
