"""How large payload and friction must be for errors of the size of the paper's figures."""

from collections.abc import Iterable

from surgsim.studies.study import Progress, Row
from surgsim.studies.vprnn.cases import (
    METHODS,
    RCM_BOUND_MM,
    TIP_BOUND_MM,
    Level,
    errors,
    outcome,
    run_case,
)
from surgsim.studies.vprnn.comparison import Runs

PAYLOADS_KG = (0.0, 0.25, 0.5, 0.75, 1.0)
FRICTIONS_NM = (0.0, 0.25, 0.5, 1.0, 2.0, 5.0)
Cell = tuple[str, Level]

GRID: tuple[Cell, ...] = tuple(
    ("vprnn", Level(payload_kg=m, coulomb_nm=f)) for m in PAYLOADS_KG for f in FRICTIONS_NM
)
"""VPRNN at every combination."""

OURS: tuple[Cell, ...] = tuple(
    ("rcm_inverse_dynamics", Level(payload_kg=m, coulomb_nm=f))
    for m in PAYLOADS_KG
    for f in FRICTIONS_NM
    if m == 0.0 or f == 0.0 or (m == PAYLOADS_KG[-1] and f in (0.5, 5.0))
)
"""Ours at each error alone, and at two of the corners."""


def ladder_row(name: str, level: Level, runs: Runs) -> Row:
    """A run at a level, taken from `runs` if it is there, and whether it stays inside the paper's bounds."""
    trace = runs[name, level] if (name, level) in runs else run_case(METHODS[name], level)
    found = errors(trace)
    inside = found["tip_max_mm"] <= TIP_BOUND_MM and found["rcm_max_mm"] <= RCM_BOUND_MM
    return {
        "controller": METHODS[name].label,
        "payload_kg": level.payload_kg,
        "friction_nm": level.coulomb_nm,
        "outcome": outcome(trace),
        **found,
        "within_5_and_15_mm": "yes" if inside else "no",
    }


def ladder_table(cells: Iterable[Cell], runs: Runs, progress: Progress) -> list[Row]:
    """Every cell."""
    rows = []
    for name, level in cells:
        progress(f"ladder, {METHODS[name].label}: {level.name}")
        rows.append(ladder_row(name, level, runs))
    return rows
