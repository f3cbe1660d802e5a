"""What the paper and surgsim state, checked against the tables."""

from collections.abc import Iterator, Mapping, Sequence
from typing import cast

from surgsim.studies.study import Claim, Row, Verdict

ATTAINED = 0.9
TIP_RMS_M = 1e-5
LIMIT_SLACK = 1e-6
TABLE_5_SHARE = 0.3
INITIAL_STEPS = 100
_METHODS = {"pinv": "not optimised", "rnn": "optimised"}


def claims_of(tables: Mapping[str, Sequence[Row]]) -> tuple[Claim, ...]:
    """Every claim with its verdict."""
    found = [
        *_averages(tables["table_4"]),
        _increase(tables["table_4_increase"]),
        *_table_5(tables["table_5"]),
    ]
    if "printed_network" in tables:
        found.append(_eq_7(tables["printed_network"]))
    return (*found, *_bound(tables["attainable"]))


def _numbers(rows: Sequence[Row], column: str) -> list[float]:
    return [float(cast(float, row[column])) for row in rows]


def _count(holds: Sequence[bool]) -> tuple[Verdict, str]:
    """The verdict of all, some or no cells, and how many of them it holds in."""
    count = sum(holds)
    verdict: Verdict = "holds" if count == len(holds) else "depends" if count else "does not hold"
    return verdict, f"{count} of {len(holds)} cells"


def _span(values: Sequence[float], digits: int = 3) -> str:
    return f"{min(values):.{digits}g} to {max(values):.{digits}g}"


def _averages(rows: Sequence[Row]) -> Iterator[Claim]:
    for method, words in _METHODS.items():
        off = _numbers(rows, f"{method}_off_percent")
        verdict, count = _count([abs(x) <= 1.0 for x in off])
        yield Claim(
            source="paper, Table 4",
            text=f"averages of mu, {words} (within 1 %)",
            verdict=verdict,
            evidence=f"{count}; off by {_span(off, 2)} %; the homes are fitted to them",
        )


def _increase(rows: Sequence[Row]) -> Claim:
    verdict, count = _count([x > 0.0 for x in _numbers(rows, "increase")])
    ours, printed = _numbers(rows, "percent"), _numbers(rows, "percent_paper")
    gaps = [a - b for a, b in zip(ours, printed, strict=True)]
    return Claim(
        source="paper, section 4",
        text="the network increases the average of mu on every path from every home",
        verdict=verdict,
        evidence=f"{count}; by {_span(ours)} %, which is {_span(gaps, 2)} percentage points off the paper's",
    )


def _table_5(rows: Sequence[Row]) -> Iterator[Claim]:
    for method, words in _METHODS.items():
        printed, parts, most = _numbers(rows, f"{method}_paper"), [], 0
        for kind in ("matched", "lagged"):
            ratio = [a / b for a, b in zip(_numbers(rows, f"{method}_{kind}"), printed, strict=True)]
            within = sum(abs(x - 1.0) <= TABLE_5_SHARE for x in ratio)
            parts.append(f"{kind}: {within} of {len(rows)} cells, {_span(ratio)} times the paper's")
            most = max(most, within)
        yield Claim(
            source="paper, Table 5",
            text=f"root mean square errors, {words} (within {100 * TABLE_5_SHARE:.0f} %)",
            verdict="holds" if most == len(rows) else "depends" if most else "does not hold",
            evidence="; ".join(parts),
        )
    peaks = _numbers(rows, "rnn_peak_step")
    verdict, count = _count([step <= INITIAL_STEPS for step in peaks])
    yield Claim(
        source="paper, section 4",
        text=f"the optimised error is largest in the initial steps (the first {INITIAL_STEPS}) and dies out",
        verdict=verdict,
        evidence=f"{count}; the peak is at step {_span(peaks, 4)}",
    )
    counts = {kind: _count(_larger(rows, kind)) for kind in ("matched", "lagged", "paper")}
    yield Claim(
        source="paper, section 4",
        text="the error is larger with optimisation than without",
        verdict=counts["matched"][0],
        evidence="; ".join(f"{kind}: {count}" for kind, (_, count) in counts.items()),
    )


def _larger(rows: Sequence[Row], kind: str) -> list[bool]:
    """Whether the optimised error of each row is the larger one."""
    errors = zip(_numbers(rows, f"pinv_{kind}"), _numbers(rows, f"rnn_{kind}"), strict=True)
    return [base < optimised for base, optimised in errors]


def _eq_7(rows: Sequence[Row]) -> Claim:
    printed = [row for row in rows if row["eq_7"] == "printed"]
    diverged = [row for row in printed if row["outcome"] == "diverged"]
    steps = ", ".join(
        f"{row['last_step']} (epsilon {row['epsilon_s']:g}, c1 {row['c1']:g})" for row in diverged
    )
    return Claim(
        source="paper, eq. (7)",
        text="the network as printed solves the problem",
        verdict="does not hold" if len(diverged) == len(printed) else "depends",
        evidence=f"{len(diverged)} of {len(printed)} settings diverge, at step {steps}; with the signs of "
        "the derivation and c1 = 1 it is stable",
    )


def _bound(rows: Sequence[Row]) -> list[Claim]:
    network, ours = _numbers(rows, "fraction_rnn"), _numbers(rows, "fraction_self_motion")
    tip = _numbers(rows, "tip_rms_m")
    reached, reached_count = _count([x >= ATTAINED for x in ours])
    exact, exact_count = _count([x <= TIP_RMS_M for x in tip])
    inside, inside_count = _count([within_limits(row) for row in rows])
    return [
        Claim(
            source="paper, section 3.2",
            text="the network reaches the largest mu",
            verdict="holds" if min(network) >= ATTAINED else "does not hold",
            evidence=f"it gains {_span([100.0 * x for x in network])} % of what self-motion could at "
            "the same tip positions inside the joint limits",
        ),
        Claim(
            source="surgsim",
            text="self_motion gains at least 90 % of the attainable mean gain in the same steps and time",
            verdict=reached,
            evidence=f"{reached_count}; {_span([100.0 * x for x in ours])} %",
        ),
        Claim(
            source="surgsim",
            text="self_motion keeps the tip within 1e-5 m RMS of its path",
            verdict=exact,
            evidence=f"{exact_count}; {_span(tip, 2)} m",
        ),
        Claim(
            source="surgsim",
            text="self_motion respects position, velocity and acceleration limits",
            verdict=inside,
            evidence=f"{inside_count}; at least {min(_numbers(rows, 'position_margin_rad')):.2g} rad from a "
            f"position limit, at most {max(_numbers(rows, 'velocity_over_limit')):.4f} of the velocity and "
            f"{max(_numbers(rows, 'acceleration_over_limit')):.4f} of the acceleration limit",
        ),
    ]


def within_limits(row: Row) -> bool:
    """Whether a row of the attainable table keeps all joint limits, up to rounding."""
    return (
        row["outcome"] == "completed"
        and float(cast(float, row["position_margin_rad"])) >= 0.0
        and float(cast(float, row["velocity_over_limit"])) <= 1.0 + LIMIT_SLACK
        and float(cast(float, row["acceleration_over_limit"])) <= 1.0 + LIMIT_SLACK
    )
