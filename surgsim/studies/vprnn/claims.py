"""The paper's claims, judged by the tables."""

from collections.abc import Mapping, Sequence

import numpy as np

from surgsim.studies.study import Claim, Row, Verdict
from surgsim.studies.vprnn.cases import (
    METHODS,
    NOMINAL,
    PAPER_METHODS,
    PAPER_SIZE,
    RCM_BOUND_MM,
    TIP_BOUND_MM,
)
from surgsim.studies.vprnn.cells import number, numbers, pick, span

Tables = Mapping[str, Sequence[Row]]
CRITERIA = (("tip_rms_mm", "tip RMS", -1.0), ("rcm_rms_mm", "RCM RMS", -1.0), ("mu_mean", "mean µ", 1.0))
"""Column, words, and whether more (1) or less (-1) is better."""
TIE = 1e-3
_LABEL = {name: method.label for name, method in METHODS.items()}


def paper_claims(tables: Tables) -> list[Claim]:
    """Every claim of the paper with its verdict."""
    return [
        *_bounded(tables, "tip_max_mm", TIP_BOUND_MM, "tip", "figure 5"),
        *_bounded(tables, "rcm_max_mm", RCM_BOUND_MM, "RCM", "figure 6"),
        _vprnn_best(tables),
        _rnn_second(tables),
        _fastest(tables),
        _random_starts(tables),
        _theorem(tables),
        _manipulability(tables),
    ]


def _bounded(tables: Tables, column: str, bound: float, words: str, source: str) -> list[Claim]:
    nominal = pick(tables["comparison"], level=NOMINAL.name)
    shown = [row for row in nominal if row["controller"] in [_LABEL[name] for name in PAPER_METHODS]]
    largest = numbers(shown, column)
    vprnn = pick(tables["ladder"], controller=_LABEL["vprnn"])
    over = [row for row in vprnn if number(row, column) > bound]
    disturbed = pick(tables["comparison"], level=PAPER_SIZE.name, controller=_LABEL["vprnn"])
    size = number(disturbed[0], column)
    alone = [axis for axis in ("payload", "friction") if _alone_exceeds(vprnn, axis, column, bound)]
    names = " and ".join(alone) or "neither"
    return [
        Claim(
            source=f"paper, {source}",
            text=f"all {words} errors are within {bound:g} mm (nominal)",
            verdict="holds" if max(largest) <= bound else "does not hold",
            evidence=f"largest {span(largest)} mm with Nullspace, RNN and VPRNN: far below the figure",
        ),
        Claim(
            source=f"paper, {source}",
            text=f"all {words} errors are within {bound:g} mm (with payload and friction)",
            verdict="depends" if over else "holds",
            evidence=f"VPRNN {size:.3g} mm with {PAPER_SIZE.name}; over the bound in {len(over)} of "
            f"{len(vprnn)} cells of the ladder, with one of the two alone: {names}",
        ),
    ]


def _alone_exceeds(rows: Sequence[Row], axis: str, column: str, bound: float) -> bool:
    other = {"payload": "friction_nm", "friction": "payload_kg"}[axis]
    return any(number(row, column) > bound for row in pick(rows, **{other: 0.0}))


def better(row: Row, other: Row) -> dict[str, float]:
    """By how much `row` is better in each criterion, as a share of `other`'s figure."""
    return {
        words: sign * (number(row, column) / number(other, column) - 1.0) for column, words, sign in CRITERIA
    }


def _percent(gain: Mapping[str, float]) -> str:
    return ", ".join(f"{words} {100.0 * value:+.2f} %" for words, value in gain.items())


def _vprnn_best(tables: Tables) -> Claim:
    all_better, parts = True, []
    for level in (NOMINAL.name, PAPER_SIZE.name):
        row = pick(tables["comparison"], level=level, controller=_LABEL["vprnn"])[0]
        for name in ("rnn", "nullspace"):
            gain = better(row, pick(tables["comparison"], level=level, controller=_LABEL[name])[0])
            all_better &= min(gain.values()) > TIE
            parts.append(f"{level}, than {_LABEL[name]}: {_percent(gain)}")
    return Claim(
        source="paper, section IV",
        text="VPRNN has the better tip error, RCM error and manipulability",
        verdict="holds" if all_better else "does not hold",
        evidence=f"better by (negative: worse): {'; '.join(parts)}",
    )


def _rnn_second(tables: Tables) -> Claim:
    rnn = pick(tables["gains"], variant="RNN, Table I")[0]
    nullspace = [row for row in tables["gains"] if str(row["variant"]).startswith("Nullspace")]
    gains = {str(row["variant"]): better(rnn, row) for row in nullspace}
    wins = [name for name, gain in gains.items() if min(gain.values()) > TIE]
    verdict: Verdict = "does not hold" if not wins else "holds" if len(wins) == len(gains) else "depends"
    return Claim(
        source="paper, section IV",
        text="RNN is better than Nullspace in all three",
        verdict=verdict,
        evidence=f"for {len(wins)} of {len(gains)} null-space gains (nominal); better by (negative: worse): "
        + "; ".join(f"{name}: {_percent(gain)}" for name, gain in gains.items()),
    )


def _fastest(tables: Tables) -> Claim:
    rates = tables["network_rates"]
    vprnn, rnn = (numbers(rates, f"{name}_1_percent_s") for name in ("vprnn", "rnn"))
    groups = pick(tables["starts"], plant="dynamic", spread="near")
    arm = "; ".join(
        f"{row['controller']} {number(row, 'tip_1_mm_from_s_median'):.2f} and "
        f"{number(row, 'rcm_1_mm_from_s_median'):.2f} s"
        for row in groups
        if row["rcm_1_mm_from_s_median"] is not None and row["tip_1_mm_from_s_median"] is not None
    )
    return Claim(
        source="paper, section IV",
        text="VPRNN has the fastest convergence rate",
        verdict="depends" if max(vprnn) < min(rnn) else "does not hold",
        evidence=f"the network: q' within 1 % after {span([1e3 * x for x in vprnn])} ms, RNN "
        f"{span([1e3 * x for x in rnn])} ms, Nullspace is algebraic; the arm from a random start (median "
        f"until tip and RCM stay below 1 mm): {arm}",
    )


def _random_starts(tables: Tables) -> Claim:
    groups = pick(tables["starts"], controller=_LABEL["vprnn"])
    complete = all(row["converged"] == row["runs"] for row in groups)
    near = pick(tables["starts"], controller=_LABEL["vprnn"], plant="dynamic", spread="near")[0]
    return Claim(
        source="paper, section V",
        text="excellent convergence even from a random initial position",
        verdict="holds" if complete else "depends" if near["converged"] else "does not hold",
        evidence="; ".join(_convergence(row) for row in groups),
    )


def _convergence(row: Row) -> str:
    counts = [round(number(row, column)) for column in ("converged", "runs", "completed")]
    text = f"{row['spread']}, {row['plant']} plant: {counts[0]} of {counts[1]} converge"
    stopped = counts[1] - counts[2]
    return f"{text}, {stopped} are stopped at a joint's limit" if stopped else text


def _theorem(tables: Tables) -> Claim:
    rows = tables["theorem_1"]
    falls = all(row["V_falls_at_every_step"] == "yes" for row in rows)
    linear, saturated = (pick(rows, activation=name) for name in ("linear", "saturated at 1"))
    closed = max(numbers(linear, "closed_form_deviation"))
    check = max(numbers(rows, "runge_kutta_deviation"))

    def fall(of: Sequence[Row]) -> str:
        return span(numbers(of, "time_to_1_percent_ms"))

    return Claim(
        source="paper, Theorem 1",
        text="delta goes to 0 from any start, V' < 0",
        verdict="holds" if falls and closed < 1e-9 and check < 1e-6 else "does not hold",
        evidence=f"V falls at every step from {len(rows)} random starts; delta(0) exp(-beta(exp(t) - 1)) to "
        f"{closed:.0e}, Runge-Kutta to {check:.0e}; 1 % after {fall(linear)} ms, saturated {fall(saturated)} "
        "ms; for eq. (27) in continuous time, not for the tip: k1, k2 and the torque law set its rate",
    )


def _manipulability(tables: Tables) -> Claim:
    gains = tables["gains"]
    none = pick(gains, variant="Nullspace, gain 0, no climbing")[0]
    found = {
        str(row["variant"]): number(row, "mu_mean_kinematic") / number(none, "mu_mean_kinematic") - 1.0
        for row in gains
        if row["mu_mean_kinematic"] is not None and str(row["variant"]).startswith(("VPRNN", "RNN"))
    }
    first = found["VPRNN, Table I"]
    climbs = float(np.max(list(found.values()))) > TIE
    return Claim(
        source="paper, section V",
        text="manipulability is optimised at the same time",
        verdict="holds" if first > TIE else "depends" if climbs else "does not hold",
        evidence="mean µ against no climbing, perfect velocity tracking: "
        + ", ".join(f"{name} {100.0 * value:+.3f} %" for name, value in found.items()),
    )
