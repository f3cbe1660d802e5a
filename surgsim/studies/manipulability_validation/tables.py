"""Tables of the study, the paper's numbers beside ours."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from surgsim.metrics.accuracy import rms
from surgsim.studies.manipulability_validation import paper
from surgsim.studies.manipulability_validation.calibrate import averages
from surgsim.studies.manipulability_validation.runs import (
    PRINTED_NETWORKS,
    Attainable,
    acceleration_ratio,
    lagged_errors,
    matched_errors,
    mean_mu,
    position_margin_rad,
    velocity_ratio,
)
from surgsim.studies.manipulability_validation.setup import (
    GIVEN_UP_HOMES_RAD,
    HOME_SOURCES,
    HOMES_RAD,
    PERIOD_S,
    STEPS,
    Cell,
    DhVariant,
    Method,
    Timing,
)
from surgsim.studies.study import Row
from surgsim.trace.trace import Trace

Sample = Sequence[tuple[str, int]]
Table = list[Row]
Cells = str | int | float | None
TABLE_5_UNITS_PER_M = 1e4
_TABLE_4: dict[Method, paper.ByPath] = {
    "pinv": paper.TABLE_4_NOT_OPTIMISED,
    "rnn": paper.TABLE_4_OPTIMISED,
}
_TABLE_5: dict[Method, paper.ByPath] = {
    "pinv": paper.TABLE_5_PSEUDO_INVERSE,
    "rnn": paper.TABLE_5_OPTIMISED,
}


@dataclass(frozen=True, kw_only=True)
class Data:
    """Everything that was run.

    Attributes:
        sample: The (path, home) pairs.
        traces: The runs.
        upper: Attainable mu of each pair.
        networks: Runs of `PRINTED_NETWORKS`; empty in a quick study.
    """

    sample: Sample
    traces: Mapping[Cell, Trace]
    upper: Mapping[tuple[str, int], Attainable]
    networks: Sequence[Trace] = field(default_factory=list)

    def trace(
        self, path: str, home: int, method: Method, timing: Timing = "paper", dh: DhVariant = "standard"
    ) -> Trace:
        """One of the runs."""
        return self.traces[Cell(path=path, home=home, method=method, timing=timing, dh_variant=dh)]


def table_4(data: Data) -> Table:
    """Averages of mu, ours and the paper's."""
    rows: Table = []
    for path, home in data.sample:
        row: dict[str, Cells] = {"path": path, "home": home}
        for method, printed in _TABLE_4.items():
            ours, theirs = mean_mu(data.trace(path, home, method)), printed[path][home - 1]
            row[method] = ours
            row[f"{method}_paper"] = theirs
            row[f"{method}_off_percent"] = 100.0 * (ours / theirs - 1.0)
        rows.append(row)
    return rows


def table_4_increase(data: Data) -> Table:
    """Increase of the averages by the network, ours and the paper's."""
    rows: Table = []
    for path, home in data.sample:
        base, optimised = (mean_mu(data.trace(path, home, method)) for method in _TABLE_4)
        rows.append(
            {
                "path": path,
                "home": home,
                "increase": optimised - base,
                "increase_paper": paper.TABLE_4_INCREASE[path][home - 1],
                "percent": 100.0 * (optimised / base - 1.0),
                "percent_paper": paper.TABLE_4_INCREASE_PERCENT[path][home - 1],
            }
        )
    return rows


def table_5(data: Data) -> Table:
    """Root mean square tip errors [1e-4 m] with matched and with lagged indices, and the paper's.

    Also the step of the network's largest matched error, and the length of a step.
    """
    rows: Table = []
    for path, home in data.sample:
        row: dict[str, Cells] = {"path": path, "home": home}
        for method, printed in _TABLE_5.items():
            trace = data.trace(path, home, method)
            row[f"{method}_paper"] = printed[path][home - 1]
            row[f"{method}_matched"] = TABLE_5_UNITS_PER_M * rms(matched_errors(trace))
            row[f"{method}_lagged"] = TABLE_5_UNITS_PER_M * rms(lagged_errors(trace))
        step = np.diff(data.trace(path, home, "pinv").block("tip_ref"), axis=0)
        row["rnn_peak_step"] = 1 + int(np.argmax(matched_errors(data.trace(path, home, "rnn"))))
        row["step_length"] = TABLE_5_UNITS_PER_M * rms(np.linalg.norm(step, axis=1))
        rows.append(row)
    return rows


def attainable_table(data: Data) -> Table:
    """How much of the attainable gain the network and our resolver reach, and our limits."""
    rows: Table = []
    for path, home in data.sample:
        ours = data.trace(path, home, "self_motion", "smooth")
        bound = data.upper[path, home]
        smooth = float(np.mean(bound.along("smooth")[1:]))
        stepped = float(np.mean(bound.along("paper")[1:]))
        base, network = (mean_mu(data.trace(path, home, method)) for method in ("pinv", "rnn"))
        start = mean_mu(data.trace(path, home, "pinv", "smooth"))
        rows.append(
            {
                "path": path,
                "home": home,
                "pinv": start,
                "self_motion": mean_mu(ours),
                "attainable": smooth,
                "fraction_rnn": (network - base) / (stepped - base),
                "fraction_self_motion": (mean_mu(ours) - start) / (smooth - start),
                "tip_rms_m": rms(matched_errors(ours)),
                "tip_max_m": float(matched_errors(ours).max()),
                "position_margin_rad": position_margin_rad(ours),
                "velocity_over_limit": velocity_ratio(ours),
                "acceleration_over_limit": acceleration_ratio(ours),
                "pinv_paper_timing_acceleration": acceleration_ratio(data.trace(path, home, "pinv")),
                "outcome": ours.meta.ending.outcome.name.lower(),
            }
        )
    return rows


def variants(data: Data) -> Table:
    """The same homes with d2 = 0.2 m as printed, and the 6x7 mu of the standard runs."""
    rows: Table = []
    for path, home in data.sample:
        row: dict[str, Cells] = {"path": path, "home": home}
        literal = [data.trace(path, home, method, dh="literal") for method in ("pinv", "rnn")]
        standard = [data.trace(path, home, method) for method in ("pinv", "rnn")]
        for name, traces, column in (
            ("standard", standard, "manipulability"),
            ("d2_literal", literal, "manipulability"),
            ("6x7", standard, "manipulability_6d"),
        ):
            base, optimised = (mean_mu(trace, column) for trace in traces)
            row[f"{name}_pinv"] = base
            row[f"{name}_rnn"] = optimised
            row[f"{name}_increase_percent"] = 100.0 * (optimised / base - 1.0)
        row["d2_literal_margin_rad"] = min(position_margin_rad(trace) for trace in literal)
        rows.append(row)
    return rows


def networks(data: Data) -> Table:
    """Where the network ends with the signs of eq. (7) as printed and as derived; home 1, circle."""
    rows: Table = []
    for keys, trace in zip(PRINTED_NETWORKS, data.networks, strict=False):
        ending = trace.meta.ending
        completed = ending.outcome.name == "COMPLETED"
        rows.append(
            {
                "eq_7": str(keys["form"]),
                "epsilon_s": float(keys["epsilon_s"]),
                "c1": float(keys["c1"]),
                "outcome": ending.outcome.name.lower(),
                "last_step": round(ending.t_s / PERIOD_S),
                "tip_error_rms_m": rms(matched_errors(trace)) if completed else None,
                "tip_error_max_m": float(matched_errors(trace).max()),
            }
        )
    return rows


def homes() -> Table:
    """The homes, where they come from, and how near a joint comes to its limit along the three paths.

    The margin is that of the pseudo-inverse and of the network's steady state without any limit.
    """
    named = [(f"{home}", q, HOME_SOURCES[home]) for home, q in HOMES_RAD.items()]
    named += [(f"{home}, given up", q, "the earlier search") for home, q in GIVEN_UP_HOMES_RAD.items()]
    _, margins = averages(np.array([q[:6] for _, q, _ in named]), STEPS)
    return [
        {
            "home": name,
            **{f"q{i + 1}_rad": x for i, x in enumerate(q)},
            "margin_rad": float(margin),
            "source": source,
        }
        for (name, q, source), margin in zip(named, margins, strict=True)
    ]
