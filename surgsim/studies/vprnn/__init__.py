"""Reproduction of the VPRNN paper: figures 4 to 8, its claims, and what they depend on."""

from collections.abc import Sequence
from functools import partial
from itertools import product

from surgsim.display import count
from surgsim.studies.compared import better, judge_told, percent, told_table
from surgsim.studies.levels import NOMINAL
from surgsim.studies.stages import judge_stages
from surgsim.studies.starts import starts_table
from surgsim.studies.study import Claim, Groups, Judged, Printed, Study, holds, in_all
from surgsim.studies.tables import Row, Tables, groups, number, numbers, pick, span
from surgsim.studies.vprnn import cases, networks, page
from surgsim.studies.vprnn.cases import ERRORS, LABEL, LADDERS, LEVELS, PAPER, PAPER_SIZE, VARIANTS, Sinusoid

TIE, SAME, SHARE, NEAR_OPTIMUM, LIKE = 1e-3, 0.1, 0.05, 0.99, 0.01
CRITERIA = (("tip_rms_mm", "tip RMS", -1.0), ("rcm_rms_mm", "RCM RMS", -1.0), ("mu_mean", "mean µ", 1.0))
"""Column, words, and whether more (1) or less (-1) is better."""
_COMPARED = ("level", "controller", "outcome", *ERRORS, "mu_mean", "mu_end", "mu_over_attainable")
_LADDER = ("controller", "payload_kg", "friction_nm", "outcome", *ERRORS, "within_5_and_15_mm")
_LARGEST = ("tip_max_mm", "rcm_max_mm")
_RESOLVERS = ("duration_s", "controller", "outcome", *ERRORS, "mu_mean")
_ARM = ("plant", "integration", "outcome", "end_s", "rows_unmet_from_s", *ERRORS)
_PAPER_LABELS = [LABEL[name] for name in cases.PAPER_METHODS]
_PLANTS: tuple[str, ...] = ("kinematic", "dynamic")
_FORMS = ("euler", "exact")


def cases_of(quick: bool) -> Groups:
    """Every case, or the sample of a quick run."""
    methods, ladders = list(cases.COMPARED), {ours: found.levels for ours, found in LADDERS.items()}
    starts = [("kinematic", "near", 20), ("dynamic", "near", 20), ("dynamic", "far", 10)]
    seeds, euler, plants = networks.SEEDS, networks.EULER, _PLANTS
    times, resolvers, led = list(cases.DURATIONS_S), list(cases.RESOLVED), list(cases.STARTED)
    laws = list(cases.LAWS)
    if quick:
        methods, ladders = list(cases.STARTED), {ours: levels[:2] for ours, levels in ladders.items()}
        starts, seeds, euler, plants = starts[1:2], (0,), ((1000.0, 1e-3),), _PLANTS[:1]
        times, laws, resolvers, led = times[1:2], [laws[0], laws[3]], resolvers[:3], ["vprnn"]
    return {
        "comparison": [Sinusoid(name, level) for level, name in product(LEVELS, methods)],
        "gains": [case for gains in VARIANTS if gains.quick or not quick for case in gains.cases],
        **{
            LADDERS[ours].table: [Sinusoid(name, level) for name in ("vprnn", ours) for level in levels]
            for ours, levels in ladders.items()
        },
        "resolvers": [cases.resolved(name, time) for time, name in product(times, resolvers)],
        "laws": [cases.resolved(name, time, law) for law, time, name in product(laws, times[:2], resolvers)],
        "hands_on": [cases.Inserted(name) for name in led],
        "network_rates": [networks.Settling(seed) for seed in seeds],
        "theorem_1": [networks.Theorem(bound, seed) for bound, seed in product(networks.BOUNDS, seeds)],
        "euler": [networks.Euler(beta, period) for beta, period in euler],
        "euler_arm": [cases.integrated(plant, form) for plant, form in product(plants, _FORMS)],
        "starts": [
            cases.Start(name, plant, spread, seed)
            for plant, spread, count in starts
            for name in cases.STARTED[: 4 if plant == "dynamic" else 3]
            for seed in range(1 if quick else count)
        ],
    }


def _nominally_bounded(column: str, bound: float, tables: Tables) -> Judged:
    rows = pick(tables["comparison"], level=str(NOMINAL))
    largest = numbers([row for row in rows if row["controller"] in _PAPER_LABELS], column)
    found = f"largest {span(largest)} mm with Nullspace, RNN and VPRNN: far below the figure"
    return holds(max(largest) <= bound), found


def _bounded(column: str, bound: float, tables: Tables) -> Judged:
    disturbed = pick(tables["comparison"], level=str(PAPER_SIZE), controller=LABEL["vprnn"])
    within, found = zip(*(x.judge_within(column, bound, tables) for x in LADDERS.values()), strict=True)
    return "holds" if all(within) else "depends", (
        f"VPRNN {number(disturbed[0], column):.3g} mm with {PAPER_SIZE}; {'; '.join(found)}"
    )


def _vprnn_best(tables: Tables) -> Judged:
    gains = {}
    for level, name in product(LEVELS, ("rnn", "nullspace")):
        rows = {row["controller"]: row for row in pick(tables["comparison"], level=str(level))}
        gains[f"{level}, than {LABEL[name]}"] = better(rows[LABEL["vprnn"]], rows[LABEL[name]], CRITERIA)
    parts = "; ".join(f"{words}: {percent(gain)}" for words, gain in gains.items())
    all_better = all(min(gain.values()) > TIE for gain in gains.values())
    return holds(all_better), f"better by (negative: worse): {parts}"


def _rnn_second(tables: Tables) -> Judged:
    rnn = pick(tables["gains"], variant="RNN, Table I")[0]
    nullspace = [row for row in tables["gains"] if str(row["variant"]).startswith("Nullspace")]
    gains = {str(row["variant"]): better(rnn, row, CRITERIA) for row in nullspace}
    wins = [min(gain.values()) > TIE for gain in gains.values()]
    return in_all(wins), (
        f"for {sum(wins)} of {len(gains)} null-space gains (nominal); better by (negative: worse): "
        + "; ".join(f"{name}: {percent(gain)}" for name, gain in gains.items())
    )


def _fastest(tables: Tables) -> Judged:
    vprnn, rnn = (numbers(tables["network_rates"], f"{name}_1_percent_s") for name in ("vprnn", "rnn"))
    medians = ("tip_1_mm_from_s_median", "rcm_1_mm_from_s_median")
    arm = "; ".join(
        f"{row['controller']} {number(row, medians[0]):.2f} and {number(row, medians[1]):.2f} s"
        for row in pick(tables["starts"], plant="dynamic", spread="near")
        if None not in (row[medians[0]], row[medians[1]])
    )
    return "depends" if max(vprnn) < min(rnn) else "does not hold", (
        f"the network: q' within 1 % after {span([1e3 * x for x in vprnn])} ms, RNN "
        f"{span([1e3 * x for x in rnn])} ms, Nullspace is algebraic; the arm from a random start (median "
        f"until tip and RCM stay below 1 mm): {arm}"
    )


def _random_starts(tables: Tables) -> Judged:
    rows = pick(tables["starts"], controller=LABEL["vprnn"])
    complete = all(row["converged"] == row["runs"] for row in rows)
    (near,) = pick(rows, plant="dynamic", spread="near")
    found = "; ".join(_convergence(row) for row in rows)
    return "holds" if complete else "depends" if near["converged"] else "does not hold", found


def _convergence(row: Row) -> str:
    converged, runs, completed = (round(number(row, name)) for name in ("converged", "runs", "completed"))
    text = f"{row['spread']}, {row['plant']} plant: {converged} of {runs} converge"
    return text + (f", {runs - completed} are stopped at a joint's limit" if completed < runs else "")


def _theorem(tables: Tables) -> Judged:
    rows = tables["theorem_1"]
    falls = all(row["V_falls_at_every_step"] == "yes" for row in rows)
    closed = max(numbers(pick(rows, activation="linear"), "closed_form_deviation"))
    check = max(numbers(rows, "runge_kutta_deviation"))
    linear, saturated = (
        span(numbers(pick(rows, activation=name), "time_to_1_percent_ms"))
        for name in ("linear", "saturated at 1")
    )
    return holds(falls and closed < 1e-9 and check < 1e-6), (
        f"V falls at every step from {count(len(rows), 'random start')}; delta(0) exp(-beta(exp(t) - 1)) to "
        f"{closed:.0e}, Runge-Kutta to {check:.0e}; 1 % after {linear} ms, saturated {saturated} "
        "ms; for eq. (27) in continuous time, not for the tip: k1, k2 and the torque law set its rate"
    )


def _manipulability(tables: Tables) -> Judged:
    gains, column = tables["gains"], "mu_mean_kinematic"
    (none,) = pick(gains, variant="Nullspace, gain 0, no climbing")
    found = {
        str(row["variant"]): number(row, column) / number(none, column) - 1.0
        for row in gains
        if row[column] is not None and str(row["variant"]).startswith(("VPRNN", "RNN"))
    }
    climbs = max(found.values()) > TIE
    return "holds" if found["VPRNN, Table I"] > TIE else "depends" if climbs else "does not hold", (
        "mean µ against no climbing, perfect velocity tracking: "
        + ", ".join(f"{name} {100.0 * value:+.3f} %" for name, value in found.items())
    )


def _law_sets_errors(tables: Tables) -> Judged:
    (base,) = pick(tables["gains"], variant="VPRNN, Table I")
    labels = ("Nullspace, gain 1 (used here)", "RNN, Table I", "VPRNN, Table I, K_N2 = D_N2 = 0")
    rows = [row for row in tables["gains"] if row["variant"] in labels]
    ratios = [number(row, c) / number(base, c) for row in rows for c in ("tip_rms_mm", "rcm_rms_mm")]
    return holds(max(abs(x - 1.0) for x in ratios) < SAME), (
        f"{span(ratios)} times VPRNN's RMS errors with Nullspace, RNN, and the resolver cut off: "
        "it enters only through K_N2 and D_N2, in the null space of [tip; RCM]"
    )


def _self_motion(tables: Tables) -> Judged | None:
    column, rows = "mu_over_attainable", tables["comparison"]
    ours = numbers(pick(rows, controller=LABEL["self_motion"]), column)
    if not ours:
        return None
    others = numbers([row for row in rows if row["controller"] in _PAPER_LABELS], column)
    best = min(ours) >= NEAR_OPTIMUM and min(ours) > max(others)
    return holds(best), f"mean of µ/µ* {span(ours, 4)} against {span(others, 4)}"


def _kinematic(tables: Tables) -> dict[str, dict[str, Row]]:
    """Rows of the kinematic plant by duration and controller."""
    found = groups(tables["resolvers"], "duration_s")
    return {f"{time:g} s": {str(row["controller"]): row for row in rows} for (time,), rows in found.items()}


def _over_rnn(columns: Sequence[str], tables: Tables) -> Judged:
    criteria, parts, wins = [c for c in CRITERIA if c[0] in columns], [], []
    for time, rows in _kinematic(tables).items():
        vprnn, rnn = (rows[LABEL[name]] for name in ("vprnn", "rnn"))
        wins += [gain > TIE for gain in better(vprnn, rnn, criteria).values()]
        figures = (f"{words} {number(vprnn, c):.4g} and {number(rnn, c):.4g}" for c, words, _ in criteria)
        parts.append(f"{time}: {', '.join(figures)}")
    return in_all(wins), f"VPRNN and RNN, path in {'; '.join(parts)} (mm, m³)"


def _like_pinv(tables: Tables) -> Judged | None:
    shares = []
    for rows in _kinematic(tables).values():
        if "pinv" in rows:
            shares += [abs(x) for x in better(rows[LABEL["vprnn"]], rows["pinv"], CRITERIA[:2]).values()]
    if not shares:
        return None
    return holds(max(shares) < LIKE), (
        f"RMS within {100.0 * max(shares):.2g} %: on exact joints what VPRNN has less than RNN is the lag of "
        "RNN's network, and an algebraic resolver has none"
    )


def _without_rows(bound: float, tables: Tables) -> Judged:
    drift = numbers(pick(tables["resolvers"], controller=LABEL["rnn_tip"]), "rcm_max_mm")
    return holds(max(drift) <= bound), f"the shaft drifts {span(drift)} mm off the trocar: no row holds it"


def _within(bound: Printed, column: str, words: str) -> list[Claim]:
    text = f"all {words} errors are within {bound.value:g} mm"
    return [
        Claim(bound.source, f"{text} (nominal)", partial(_nominally_bounded, column, bound.value)),
        Claim(bound.source, f"{text} (with payload and friction)", partial(_bounded, column, bound.value)),
    ]


_ON, _TIP_RCM, _BOUND = "(kinematic plant)", ("tip_rms_mm", "rcm_rms_mm"), PAPER.printed["rcm_bound"]
_ROWS_TEXT = f"all RCM errors are within 15 mm (RNN as Table I lists it, without RCM rows) {_ON}"
_TOLD_TEXT = "a torque law lets VPRNN be told from RNN (RMS tip or RCM error apart by 10 % and 1 µm)"
_inserted = partial(judge_stages, PAPER["tip_bound"], PAPER["rcm_bound"])
_IV, _V = "paper, section IV", "paper, section V"
_EULER_TEXT = "explicit Euler of eq. (29) breaks at ln(2/(T beta)), the closed form does not"
_STEADY_TEXT = "both networks end at pinv(J) v + k N grad(ln µ), k = h0/h1 = 0.01 and k = c3/c2 = 1"
_LAW_TEXT = "under torques the impedance law sets tip and RCM error, not the resolver"
_OURS_TEXT = "{} has at most a twentieth of VPRNN's largest tip and RCM error in every cell, on {} drives"
_MU_TEXT = f"self_motion has at least {100.0 * NEAR_OPTIMUM:g} % of attainable µ, the paper's three less"

STUDY = Study(
    name="vprnn",
    heading="VPRNN paper: reproduction",
    introduction=page.INTRODUCTION,
    quick_note="a sample of the cells, without figures",
    paper=PAPER,
    cases=cases_of,
    tables={
        "comparison": lambda results: results.rows("comparison", *_COMPARED),
        "gains": cases.gains_table,
        **{ladder.table: partial(ladder.rows, _LADDER) for ladder in LADDERS.values()},
        "resolvers": lambda results: results.rows("resolvers", *_RESOLVERS),
        "laws": lambda results: told_table(results.rows("laws"), LABEL["vprnn"], LABEL["rnn"]),
        "laws_every_run": lambda results: results.rows("laws", "torque_law", "evaluated_at", *_RESOLVERS),
        "hands_on": lambda results: results.rows("hands_on"),
        "network_rates": lambda results: results.rows("network_rates"),
        "theorem_1": lambda results: results.rows("theorem_1"),
        "euler": lambda results: results.rows("euler"),
        "euler_arm": lambda results: results.rows("euler_arm", *_ARM),
        "starts": lambda results: starts_table(results.rows("starts")),
        "starts_every_run": lambda results: results.rows("starts"),
    },
    claims=[
        *_within(PAPER.printed["tip_bound"], "tip_max_mm", "tip"),
        *_within(PAPER.printed["rcm_bound"], "rcm_max_mm", "RCM"),
        Claim(_IV, "VPRNN has the better tip error, RCM error and manipulability", _vprnn_best),
        Claim(_IV, f"VPRNN has the better tip and RCM error than RNN {_ON}", partial(_over_rnn, _TIP_RCM)),
        Claim(_IV, f"VPRNN has the better manipulability than RNN {_ON}", partial(_over_rnn, ("mu_mean",))),
        Claim(_BOUND.source, _ROWS_TEXT, partial(_without_rows, _BOUND.value)),
        Claim(_IV, "RNN is better than Nullspace in all three", _rnn_second),
        Claim(_IV, "VPRNN has the fastest convergence rate", _fastest),
        Claim(_V, "excellent convergence even from a random initial position", _random_starts),
        Claim("paper, figure 3", "hands-on insertion, then tracking, within 5 and 15 mm", _inserted),
        Claim("paper, Theorem 1", "delta goes to 0 from any start, V' < 0", _theorem),
        Claim(_V, "manipulability is optimised at the same time", _manipulability),
        Claim("surgsim", _EULER_TEXT, networks.judge_euler),
        Claim("surgsim", _STEADY_TEXT, networks.judge_steady_state),
        Claim("surgsim", f"VPRNN has pinv's tip and RCM error within {100 * LIKE:g} % {_ON}", _like_pinv),
        Claim("surgsim", _TOLD_TEXT, partial(judge_told, "hierarchical_impedance", "rnn")),
        Claim("surgsim", _LAW_TEXT, _law_sets_errors),
        *(
            Claim(
                "surgsim", _OURS_TEXT.format(ours, ladder.drive), partial(ladder.judge_share, _LARGEST, SHARE)
            )
            for ours, ladder in LADDERS.items()
        ),
        Claim("surgsim", _MU_TEXT, _self_motion),
    ],
    sections=page.SECTIONS,
    figures=page.FIGURES,
)
