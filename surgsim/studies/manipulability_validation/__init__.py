"""Reproduction of the manipulability paper: its tables and figures, and a bound it does not give."""

from collections.abc import Sequence
from functools import partial
from itertools import product

import numpy as np

from surgsim.studies.manipulability_validation import calibrate, cases, page
from surgsim.studies.manipulability_validation.cases import HOMES, PAPER, PATHS, Cell
from surgsim.studies.study import Claim, Groups, Judged, Results, Study, Verdict, holds, in_all
from surgsim.studies.tables import Row, Tables, number, numbers, pick, span

ATTAINED, TIP_RMS_M, LIMIT_SLACK, TABLE_5_SHARE, INITIAL_STEPS = 0.9, 1e-5, 1e-6, 0.3, 100
METHODS = {"pinv": "not optimised", "rnn": "optimised"}
QUICK_SAMPLE = (("circle", 3), ("sinusoid", 4))


def cases_of(quick: bool) -> Groups:
    """Every case; two of the twelve (path, home) pairs without variants in a quick run."""
    sample = QUICK_SAMPLE if quick else tuple(product(PATHS, HOMES))
    found: Groups = {
        "paper": [Cell(*which, method) for which, method in product(sample, METHODS)],
        "smooth": [
            Cell(*which, method, "smooth") for which, method in product(sample, ("pinv", "self_motion"))
        ],
    }
    if quick:
        return found
    named = [(f"{home}", q, calibrate.HOME_SOURCES[home]) for home, q in calibrate.HOMES_RAD.items()]
    given_up = [
        (f"{home}, given up", q, "the earlier search") for home, q in calibrate.GIVEN_UP_HOMES_RAD.items()
    ]
    return {
        **found,
        "literal": [Cell(*which, method, dh_variant="literal") for which, method in product(sample, METHODS)],
        "printed_network": cases.PRINTED_NETWORKS,
        "homes": [calibrate.Home(*home) for home in (*named, *given_up)],
    }


def table_4(results: Results) -> Sequence[Row]:
    """Averages of mu, ours and the paper's."""
    return [
        {
            **_place(pinv),
            **_beside_the_paper("pinv", pinv),
            **_beside_the_paper("rnn", rnn),
        }
        for pinv, rnn in _pairs(results, "paper")
    ]


def _pairs(results: Results, group: str) -> list[tuple[Row, Row]]:
    """Both methods' measures for each (path, home)."""
    rows = results.rows(group)
    return list(zip(rows[::2], rows[1::2], strict=True))


def _place(row: Row) -> Row:
    return {"path": row["path"], "home": row["home"]}


def _printed(name: str, row: Row) -> float:
    """The paper's number at a row's path and home."""
    value: float = PAPER[name][row["path"]][int(number(row, "home")) - 1]
    return value


def _beside_the_paper(method: str, row: Row) -> Row:
    ours, theirs = number(row, "mu_mean"), _printed(method, row)
    return {method: ours, f"{method}_paper": theirs, f"{method}_off_percent": 100.0 * (ours / theirs - 1.0)}


def table_4_increase(results: Results) -> Sequence[Row]:
    """Increase of the averages by the network, ours and the paper's."""
    return [
        {
            **_place(pinv),
            "increase": number(rnn, "mu_mean") - number(pinv, "mu_mean"),
            "increase_paper": _printed("increase", pinv),
            "percent": _increase_percent(pinv, rnn),
            "percent_paper": _printed("percent", pinv),
        }
        for pinv, rnn in _pairs(results, "paper")
    ]


def _increase_percent(pinv: Row, rnn: Row, column: str = "mu_mean") -> float:
    return 100.0 * (number(rnn, column) / number(pinv, column) - 1.0)


def table_5(results: Results) -> Sequence[Row]:
    """Root mean square tip errors [1e-4 m] with matched and with lagged indices, and the paper's.

    Also the step of the network's largest matched error, and the length of a step.
    """
    rows, scale = [], cases.TABLE_5_UNITS_PER_M
    for pinv, rnn in _pairs(results, "paper"):
        row = dict(_place(pinv))
        for method, found in (("pinv", pinv), ("rnn", rnn)):
            row[f"{method}_paper"] = _printed(f"{method}_error", found)
            for kind in ("matched", "lagged"):
                row[f"{method}_{kind}"] = scale * number(found, f"{kind}_rms_m")
        peak, length = rnn["matched_peak_step"], scale * number(pinv, "step_rms_m")
        rows.append({**row, "rnn_peak_step": peak, "step_length": length})
    return rows


def attainable_table(results: Results) -> Sequence[Row]:
    """How much of the attainable gain the network and our resolver reach, and our limits."""
    rows = []
    for (pinv, rnn), (start, ours) in zip(_pairs(results, "paper"), _pairs(results, "smooth"), strict=True):
        bound = cases.upper_bound(results, str(pinv["path"]), int(number(pinv, "home")))
        smooth, stepped = (float(np.mean(bound[timing][1:])) for timing in ("smooth", "paper"))
        base, network, slow, best = (number(row, "mu_mean") for row in (pinv, rnn, start, ours))
        limits = ("position_margin_rad", "velocity_over_limit", "acceleration_over_limit")
        rows.append(
            {
                **_place(pinv),
                "pinv": slow,
                "self_motion": best,
                "attainable": smooth,
                "fraction_rnn": (network - base) / (stepped - base),
                "fraction_self_motion": (best - slow) / (smooth - slow),
                "tip_rms_m": ours["matched_rms_m"],
                "tip_max_m": ours["matched_max_m"],
                **{name: ours[name] for name in limits},
                "pinv_paper_timing_acceleration": pinv["acceleration_over_limit"],
                "outcome": ours["outcome"],
            }
        )
    return rows


def variants(results: Results) -> Sequence[Row]:
    """The same homes with d2 = 0.2 m as printed, and the 6x7 mu of the standard runs."""
    rows = []
    for standard, literal in zip(_pairs(results, "paper"), _pairs(results, "literal"), strict=False):
        row = dict(_place(standard[0]))
        kinds = (("standard", standard, ""), ("d2_literal", literal, ""), ("6x7", standard, "6d_"))
        for name, (pinv, rnn), kind in kinds:
            row |= {f"{name}_pinv": pinv[f"mu_{kind}mean"], f"{name}_rnn": rnn[f"mu_{kind}mean"]}
            row[f"{name}_increase_percent"] = _increase_percent(pinv, rnn, f"mu_{kind}mean")
        rows.append({**row, "d2_literal_margin_rad": min(numbers(literal, "position_margin_rad"))})
    return rows


def printed_network(results: Results) -> Sequence[Row]:
    """Where the network ends with the signs of eq. (7) as printed and as derived; home 1, circle."""
    return [
        {
            "eq_7": m.case.form,
            **dict(m.case.constants),
            **m.only("outcome", "last_step"),
            "tip_error_rms_m": m.row["matched_rms_m"] if m.row["outcome"] == "completed" else None,
            "tip_error_max_m": m.row["matched_max_m"],
        }
        for m in results["printed_network"]
    ]


def _share(flags: Sequence[bool]) -> tuple[Verdict, str]:
    """The verdict of all, some or no cells, and how many of them it holds in."""
    return in_all(flags), f"{sum(flags)} of {len(flags)} cells"


def _averages(method: str, tables: Tables) -> Judged:
    off = numbers(tables["table_4"], f"{method}_off_percent")
    verdict, count = _share([abs(x) <= 1.0 for x in off])
    return verdict, f"{count}; off by {span(off, 2)} %; the homes are fitted to them"


def _increase(tables: Tables) -> Judged:
    rows = tables["table_4_increase"]
    verdict, count = _share([x > 0.0 for x in numbers(rows, "increase")])
    ours, printed = numbers(rows, "percent"), numbers(rows, "percent_paper")
    gaps = span([a - b for a, b in zip(ours, printed, strict=True)], 2)
    return verdict, f"{count}; by {span(ours)} %, which is {gaps} percentage points off the paper's"


def _table_5(method: str, tables: Tables) -> Judged:
    rows, parts, most = tables["table_5"], [], 0
    for kind in ("matched", "lagged"):
        ratios = [number(row, f"{method}_{kind}") / number(row, f"{method}_paper") for row in rows]
        within = sum(abs(x - 1.0) <= TABLE_5_SHARE for x in ratios)
        parts.append(f"{kind}: {within} of {len(rows)} cells, {span(ratios)} times the paper's")
        most = max(most, within)
    return "holds" if most == len(rows) else "depends" if most else "does not hold", "; ".join(parts)


def _peak(tables: Tables) -> Judged:
    peaks = numbers(tables["table_5"], "rnn_peak_step")
    verdict, count = _share([step <= INITIAL_STEPS for step in peaks])
    return verdict, f"{count}; the peak is at step {span(peaks, 4)}"


def _larger(tables: Tables) -> Judged:
    found = {
        kind: _share([number(row, f"pinv_{kind}") < number(row, f"rnn_{kind}") for row in tables["table_5"]])
        for kind in ("matched", "lagged", "paper")
    }
    return found["matched"][0], "; ".join(f"{kind}: {count}" for kind, (_, count) in found.items())


def _eq_7(tables: Tables) -> Judged | None:
    printed = pick(tables.get("printed_network", ()), eq_7="printed")
    if not printed:
        return None
    diverged = pick(printed, outcome="diverged")
    steps = ", ".join(
        f"{row['last_step']} (epsilon {row['epsilon_s']:g}, c1 {row['c1']:g})" for row in diverged
    )
    return "does not hold" if len(diverged) == len(printed) else "depends", (
        f"{len(diverged)} of {len(printed)} settings diverge, at step {steps}; with the signs of "
        "the derivation and c1 = 1 it is stable"
    )


def _network_bound(tables: Tables) -> Judged:
    network = numbers(tables["attainable"], "fraction_rnn")
    return holds(min(network) >= ATTAINED), (
        f"it gains {span([100.0 * x for x in network])} % of what self-motion could at "
        "the same tip positions inside the joint limits"
    )


def _attained(tables: Tables) -> Judged:
    ours = numbers(tables["attainable"], "fraction_self_motion")
    verdict, count = _share([x >= ATTAINED for x in ours])
    return verdict, f"{count}; {span([100.0 * x for x in ours])} %"


def _exact(tables: Tables) -> Judged:
    tip = numbers(tables["attainable"], "tip_rms_m")
    verdict, count = _share([x <= TIP_RMS_M for x in tip])
    return verdict, f"{count}; {span(tip, 2)} m"


def _inside(tables: Tables) -> Judged:
    rows = tables["attainable"]
    verdict, count = _share([within_limits(row) for row in rows])
    return verdict, (
        f"{count}; at least {min(numbers(rows, 'position_margin_rad')):.2g} rad from a "
        f"position limit, at most {max(numbers(rows, 'velocity_over_limit')):.4f} of the velocity and "
        f"{max(numbers(rows, 'acceleration_over_limit')):.4f} of the acceleration limit"
    )


def within_limits(row: Row) -> bool:
    """Whether a row of the attainable table keeps all joint limits, up to rounding."""
    most = max(number(row, "velocity_over_limit"), number(row, "acceleration_over_limit"))
    inside = number(row, "position_margin_rad") >= 0.0 and most <= 1.0 + LIMIT_SLACK
    return row["outcome"] == "completed" and inside


_PEAK_TEXT = f"the optimised error is largest in the initial steps (the first {INITIAL_STEPS}) and dies out"
_GAIN_TEXT = "self_motion gains at least 90 % of the attainable mean gain in the same steps and time"
_4, _5, _SECTION = "paper, Table 4", "paper, Table 5", "paper, section 4"
STUDY = Study(
    name="manipulability_validation",
    heading="Manipulability paper: reproduction",
    introduction=page.INTRODUCTION,
    quick_note="a sample of the cells, without variants and figures",
    paper=PAPER,
    cases=cases_of,
    tables={
        "table_4": table_4,
        "table_4_increase": table_4_increase,
        "table_5": table_5,
        "attainable": attainable_table,
        "variants": variants,
        "printed_network": printed_network,
        "homes": lambda results: results.rows("homes"),
    },
    claims=[
        *(Claim(_4, f"averages of mu, {METHODS[m]} (within 1 %)", partial(_averages, m)) for m in METHODS),
        Claim(_SECTION, "the network increases the average of mu on every path from every home", _increase),
        *(
            Claim(
                _5,
                f"root mean square errors, {METHODS[m]} (within {100 * TABLE_5_SHARE:.0f} %)",
                partial(_table_5, m),
            )
            for m in METHODS
        ),
        Claim(_SECTION, _PEAK_TEXT, _peak),
        Claim(_SECTION, "the error is larger with optimisation than without", _larger),
        Claim("paper, eq. (7)", "the network as printed solves the problem", _eq_7),
        Claim("paper, section 3.2", "the network reaches the largest mu", _network_bound),
        Claim("surgsim", _GAIN_TEXT, _attained),
        Claim("surgsim", "self_motion keeps the tip within 1e-5 m RMS of its path", _exact),
        Claim("surgsim", "self_motion respects position, velocity and acceleration limits", _inside),
    ],
    sections=page.SECTIONS,
    figures=page.FIGURES,
)
