"""Draws `controllers/*.png` and prints the tables of docs/controllers. Names as arguments choose some.

The names: a shipped controller, `frontier` (some minutes), `swivel`, `table`. `docs/controllers/README.md`
holds what `table` prints, `rcm_inverse_dynamics.md` what `frontier` prints.
"""

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from surgsim.control.self_motion import SelfMotion, elbow_swivel_rad
from surgsim.metrics.catalog import compute_metrics
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate
from surgsim.simulate.setup import prepare
from surgsim.studies.figure import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILLION, figure, legend_below

OUT = Path(__file__).with_name("controllers")
SCENARIO = "circle_lwr4plus"
CONTROLLERS = (
    "vprnn",
    "pinv",
    "gradient",
    "rnn",
    "qp",
    "mink",
    "vector_field_inequalities",
    "joint_impedance",
    "hierarchical_qp",
    "rcm_inverse_dynamics",
    "self_motion",
    "constraint_consistent",
    "rcm_elastic_dynamics",
    "rcm_mpc",
)
PUSH = "disturbances=[{type: push}]"
CONDITIONS = {
    "nominal": "disturbances=[]",
    "model errors": "disturbances=[{type: payload}, {type: joint_friction}, {type: inertia_error}]",
    "push": PUSH,
    "delay": "disturbances=[{type: actuation_delay}]",
}
CAPTIONS = {
    "nominal": "nominal",
    "model errors": "payload 0.2 kg, friction 0.5 N m, inertia +10 %",
    "push": "push at the tip, 5 N from 3 to 6 s",
    "delay": "actuation delay 5 ms",
}
STYLES = {
    "nominal": (BLACK, "-", 2.0),
    "model errors": (BLUE, "-", 1.4),
    "push": (VERMILLION, "-", 1.4),
    "delay": (PURPLE, "--", 1.4),
}
COLUMNS = ("tip_error_rms_mm", "tip_error_max_mm", "rcm_error_rms_mm", "rcm_error_max_mm")
STIFFNESSES = (1e3, 4e3, 1e4, 2e4, 4e4)
OBSERVER_GAINS = (0.02, 0.3)
DELAYS_MS = tuple(range(1, 11))
FAILED_MM, STOPPED_MM = 1.0, 50.0


def run(controller: str, assignments: Sequence[str]) -> tuple[str, dict[str, Any], dict[str, np.ndarray]]:
    """Outcome, metrics and error columns of the circle with `controller`."""
    trace = simulate(load_scenario(SCENARIO, controller=controller, assignments=assignments))
    columns = {name: trace[name].ravel().copy() for name in ("t_s", "tip_error_m", "rcm_error_m")}
    ending = trace.meta.ending
    return ending.outcome.name.lower(), {**compute_metrics(trace), "end_s": ending.t_s}, columns


def many(jobs: Sequence[tuple[str, Sequence[str]]]) -> list[tuple[str, dict, dict]]:
    """`run` of every job, on two processes."""
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        return list(pool.map(run, *zip(*jobs, strict=True)))


def draw_errors(controller: str, results: dict[str, tuple[str, dict, dict]]) -> None:
    """Tip and RCM error over time under every condition, the same axes for every controller."""
    title = f"{controller} on {SCENARIO}"
    with figure(OUT / f"{controller}.png", title, 1, 2, (9.0, 3.6), sharex=True, sharey=True) as axes:
        for condition, (outcome, _, columns) in results.items():
            color, line, width = STYLES[condition]
            label = CAPTIONS[condition] + ("" if outcome == "completed" else f" ({outcome})")
            for ax, key in zip(axes.flat, ("tip_error_m", "rcm_error_m"), strict=True):
                error = np.maximum(1e3 * columns[key], 1e-9)
                ax.plot(columns["t_s"], error, line, color=color, linewidth=width, label=label)
                if outcome != "completed":
                    ax.plot(columns["t_s"][-1], error[-1], "X", color=color, markersize=9, clip_on=False)
        for ax, what in zip(axes.flat, ("tip error [mm]", "RCM error [mm]"), strict=True):
            ax.set(yscale="log", ylim=(1e-6, 1e2), xlim=(0.0, 11.0), xlabel="time [s]", ylabel=what)
            ax.tick_params(labelleft=True)
        legend_below(axes, 2)


def measure(names: Sequence[str]) -> dict[str, dict[str, tuple[str, dict, dict]]]:
    """Results of the controllers `names` under every condition."""
    jobs = [(name, (CONDITIONS[condition],)) for name in names for condition in CONDITIONS]
    results = iter(many(jobs))
    return {name: {condition: next(results) for condition in CONDITIONS} for name in names}


def print_table(measured: dict[str, dict[str, tuple[str, dict, dict]]]) -> None:
    """The table of docs/controllers/README.md."""
    print("| controller | condition | outcome | tip RMS | tip max | RCM RMS | RCM max |")
    print("|---|---|---|---|---|---|---|")
    for name, results in measured.items():
        for condition, (outcome, metrics, _) in results.items():
            values = " | ".join(_number(metrics[key]) for key in COLUMNS)
            end = outcome if outcome == "completed" else f"{outcome} at {metrics['end_s']:.2f} s"
            print(f"| [{name}]({name}.md) | {condition} | {end} | {values} |")


def _number(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.3g}" if 1e-3 <= value < 1e3 else f"{value:.1e}"


def gains(stiffness: float, observer: float) -> tuple[str, ...]:
    """Overrides of rcm_inverse_dynamics: the tip half as stiff as the RCM."""
    law = "controller.torque_law"
    return (
        f"{law}.rcm_stiffness_per_s2={stiffness}",
        f"{law}.tip_stiffness_per_s2={stiffness / 2.0}",
        f"{law}.observer_gain={observer}",
    )


def frontier() -> None:
    """RCM error of rcm_inverse_dynamics over delay, with and without prediction, for gains and observers."""
    name = "rcm_inverse_dynamics"
    cases = [(k, gain) for gain in OBSERVER_GAINS for k in STIFFNESSES]
    off = "controller.torque_law.most_delay_ticks=0"
    jobs = []
    for k, gain in cases:
        for delay in DELAYS_MS:
            delayed = f"disturbances=[{{type: actuation_delay, delay_s: {delay / 1000.0}}}]"
            jobs += [(name, (*gains(k, gain), delayed)), (name, (*gains(k, gain), delayed, off))]
        jobs.append((name, (*gains(k, gain), PUSH)))
        jobs.append((name, (*gains(k, gain), "disturbances=[{type: push}, {type: actuation_delay}]")))
        jobs.append((name, (*gains(k, gain), CONDITIONS["model errors"])))
        both = CONDITIONS["model errors"].replace("]", ", {type: actuation_delay}]")
        jobs.append((name, (*gains(k, gain), both)))
    results = iter(many(jobs))
    worst: dict[tuple[float, float], dict[str, Any]] = {}
    for case in cases:
        pairs = [(_rcm_max(*next(results)), _rcm_max(*next(results))) for _ in DELAYS_MS]
        entry: dict[str, Any] = {"with": [a for a, _ in pairs], "without": [b for _, b in pairs]}
        for key in ("push", "push, delay", "errors", "errors, delay"):
            entry[key] = _rcm_max(*next(results))
        worst[case] = entry
    _print_frontier(worst)
    _draw_frontier(worst)


def _rcm_max(outcome: str, metrics: dict, columns: dict) -> float:
    """Largest RCM error [mm], infinite where the run did not complete."""
    return float(metrics["rcm_error_max_mm"]) if outcome == "completed" else np.inf


def _survived(errors: list[float]) -> str:
    """The longest delay up to which every run completed with an RCM error below a millimetre."""
    good = 0
    while good < len(errors) and errors[good] < FAILED_MM:
        good += 1
    return f"{DELAYS_MS[good - 1]}" if good else "none"


def _print_frontier(worst: dict[tuple[float, float], dict[str, Any]]) -> None:
    print("| L | k_r | bound 0.647/√k_r | without | with | push | push, 5 ms | errors | errors, 5 ms |")
    print("|---|---|---|---|---|---|---|---|---|")
    for (k, gain), entry in worst.items():
        extra = [
            "fails" if np.isinf(entry[key]) else _number(entry[key])
            for key in ("push", "push, delay", "errors", "errors, delay")
        ]
        bound = 647.0 / k**0.5
        row = [f"{gain:g}", f"{k:g}", f"{bound:.1f}", _survived(entry["without"]), _survived(entry["with"])]
        print("| " + " | ".join([*row, *extra]) + " |")
        print(" ", "without", [_number(x) for x in entry["without"]], file=sys.stderr)
        print(" ", "with   ", [_number(x) for x in entry["with"]], file=sys.stderr)


def _draw_frontier(worst: dict[tuple[float, float], dict[str, Any]]) -> None:
    """Left: over the delay, for the last observer gain. Right: under a push, over the stiffness."""
    colors = (GREEN, BLUE, ORANGE, VERMILLION, BLACK)
    gain = OBSERVER_GAINS[-1]
    with figure(OUT / "frontier.png", f"rcm_inverse_dynamics on {SCENARIO}", 1, 2, (9.5, 4.2)) as axes:
        left, right = axes.flat
        for k, color, mark in zip(STIFFNESSES, colors, "osD^v", strict=True):
            for key, line, face in (("without", "--", "white"), ("with", "-", color)):
                errors = np.array(worst[k, gain][key])
                style = {"color": color, "markerfacecolor": face, "markersize": 5, "linewidth": 1.2}
                label = f"k_r = {k:g} /s²" if key == "with" else None
                left.plot(DELAYS_MS, np.minimum(errors, STOPPED_MM), line + mark, label=label, **style)
        left.axhline(STOPPED_MM, color="0.5", linewidth=0.8)
        left.annotate("stopped at a limit", (6.4, 0.6 * STOPPED_MM), va="top", fontsize=9, color="0.3")
        left.set(yscale="log", ylim=(5e-6, 1e2), xlabel="actuation delay [ms]", xticks=DELAYS_MS)
        left.set(ylabel="largest RCM error [mm]", title="delay; dashed: without prediction")
        for observer, color in zip(OBSERVER_GAINS, (PURPLE, BLUE), strict=True):
            for key, line, what in (("push", "-o", "no delay"), ("push, delay", ":s", "5 ms, predicted")):
                errors = [worst[k, observer][key] for k in STIFFNESSES]
                right.plot(STIFFNESSES, errors, line, color=color, label=f"L = {observer:g}, {what}")
        right.set(xscale="log", yscale="log", ylim=(1e-2, 1e1), xlabel="RCM stiffness k_r [1/s²]")
        right.set(ylabel="largest RCM error [mm]", title="push of 5 N at the tip")
        right.legend(fontsize=9, frameon=False, loc="upper right")
        legend_below(axes, len(STIFFNESSES))


def swivel() -> None:
    """The manipulability over the elbow swivel at the start of the sinusoid, its optimum and its ends."""
    setup = prepare(load_scenario("sinusoid_lwr4plus"))
    assert setup.scenario.trocar is not None
    p_WC = np.array(setup.scenario.trocar.position_m)
    p_WT = setup.arm.kinematics(setup.q_start).p_WT
    curve = SelfMotion(setup.arm).swivel_curve(setup.q_start, p_WT, p_WC)
    angle = np.unwrap([elbow_swivel_rad(point.kin) for point in curve])
    mu = np.array([point.mu for point in curve])
    here = int(np.argmin([np.linalg.norm(point.q - setup.q_start) for point in curve]))
    best = int(np.argmax(mu))
    limits = setup.arm.limits
    with figure(
        OUT / "swivel.png",
        "Manipulability over the elbow swivel, start of sinusoid_lwr4plus",
        size=(7.0, 3.8),
    ) as axes:
        ax = axes[0, 0]
        ax.plot(angle, mu, color=BLUE, linewidth=2.0)
        ax.plot(angle[here], mu[here], "o", color=BLACK, markersize=8, label=f"start, µ = {mu[here]:.4f}")
        ax.plot(
            angle[best], mu[best], "*", color=VERMILLION, markersize=15, label=f"largest, µ = {mu[best]:.4f}"
        )
        for end, side in ((0, "right"), (-1, "left")):
            room = np.minimum(curve[end].q - limits.q_min, limits.q_max - curve[end].q)
            label = "end: a joint limit" if end == 0 else None
            ax.plot(angle[end], mu[end], "|", color=PURPLE, markersize=20, markeredgewidth=3, label=label)
            text = f"joint {int(np.argmin(room)) + 1} at its limit\nµ = {mu[end]:.4f}"
            ax.annotate(text, (angle[end], mu[end] - 0.03), ha=side, va="top", fontsize=9)
        ax.set(xlabel="elbow swivel [rad], 0 = elbow highest", ylabel="µ [m³]")
        ax.set_ylim(0.0, 1.12 * mu.max())
        ax.legend(fontsize=9, frameon=False, loc="lower center", markerscale=0.7)
    print(
        "swivel from",
        angle[0],
        "to",
        angle[-1],
        "start",
        angle[here],
        mu[here],
        "best",
        angle[best],
        mu[best],
    )


def main(names: Sequence[str]) -> int:
    """Make what `names` ask for; everything without names."""
    OUT.mkdir(exist_ok=True)
    wanted = list(names) or [*CONTROLLERS, "table", "swivel", "frontier"]
    known = {"swivel": swivel, "frontier": frontier, "table": None} | dict.fromkeys(CONTROLLERS)
    unknown = [name for name in wanted if name not in known]
    if unknown:
        print(f"no such figure: {', '.join(unknown)}; known: {', '.join(known)}", file=sys.stderr)
        return 2
    chosen = CONTROLLERS if "table" in wanted else [name for name in CONTROLLERS if name in wanted]
    measured = measure(chosen) if chosen else {}
    for name in wanted:
        if name in measured:
            draw_errors(name, measured[name])
    if "table" in wanted:
        print_table(measured)
    parts: list[Callable[[], None]] = [swivel, frontier]
    for part in parts:
        if part.__name__ in wanted:
            part()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
