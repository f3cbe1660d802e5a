"""Writes the tables of docs/controllers/constraint_consistent.md: runs of the four torque-level settings.

A table stands between `<!-- made NAME -->` and `<!-- end -->`. Names as arguments choose some; all take about
two minutes on two cores.
"""

import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from surgsim.control.rcm import rcm_kinematics
from surgsim.metrics.catalog import compute_metrics
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate
from surgsim.simulate.setup import prepare
from surgsim.trace.trace import Trace

PAGE = Path(__file__).resolve().parents[1] / "controllers" / "constraint_consistent.md"
LAW = "controller.torque_law."
OURS = "constraint_consistent"
ARMS = {"lwr4plus": "LWR4+", "panda": "Panda"}
SETTINGS = {
    "spiral": "spiral",
    "insertion_depth": "varying depth",
    "moving_trocar": "moving trocar",
    "human_push": "human push",
}
CONTROLLERS = (
    OURS,
    "rcm_inverse_dynamics",
    "null_space_basis",
    "projected_jacobian",
    "joint_impedance",
    "vprnn",
)
RIVALS = ("null_space_basis", "projected_jacobian", "joint_impedance", "vprnn")
FREE, CONSTRAINT = ("tip", "posture", "free_bias"), ("constraint", "constraint_bias")
STAND = (
    "simulation.timestep_s=0.00025",
    "trocar.wall={lateral_stiffness_n_per_m: 1.0e+5, lateral_damping_n_s_per_m: 200.0, mass_kg: 0.5, "
    "contact_stiffness_n_per_m: 1.0e+6, contact_damping_n_s_per_m: 100.0, tear_force_n: 1000.0}",
)
TISSUE = ("trocar.wall={}",)
SHARES = ((1.0, 1.0), (0.0, 1.0), (0.0, 0.0))


@dataclass(frozen=True, kw_only=True)
class Job:
    """A run.

    Attributes:
        scenario: The shipped scenario.
        controller: The shipped controller.
        settings: Values instead of theirs.
    """

    scenario: str
    controller: str = OURS
    settings: tuple[str, ...] = ()


def measure(job: Job) -> dict[str, float | str]:
    """Metrics of a run, its outcome, and what its torques are beyond gravity, free and constrained [N m]."""
    scenario = load_scenario(job.scenario, controller=job.controller, assignments=job.settings)
    trace = simulate(scenario)
    found = {key: np.nan if value is None else value for key, value in compute_metrics(trace).items()}
    ending = trace.meta.ending
    done = ending.outcome.name.lower()
    found["outcome"] = done if done == "completed" else f"{done} at {ending.t_s:.2f} s"
    moving = trace.block("tau") - _gravity(job, trace)
    moving = moving[np.isfinite(moving).all(axis=1)]
    found["beyond_mean"] = np.linalg.norm(moving, axis=1).mean()
    found["beyond_peak"] = np.abs(moving).max()
    if job.controller == OURS:
        for name, terms in (("free", FREE), ("constraint", CONSTRAINT)):
            torque = sum(trace.block(f"tau_{term}_") for term in terms)
            found[name] = np.nanmean(np.linalg.norm(torque, axis=1))
    return found


def _gravity(job: Job, trace: Trace) -> np.ndarray:
    """Gravity torque of the nominal arm along the run (rows, n) [N m]."""
    arm = prepare(load_scenario(job.scenario, controller=job.controller, assignments=job.settings)).arm
    q = trace.block("q")
    return np.array([arm.dynamics(row, np.zeros_like(row)).bias for row in q])


def many(jobs: Sequence[Job]) -> list[dict[str, float | str]]:
    """`measure` of every job, on two processes."""
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        return list(pool.map(measure, jobs))


def table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    return "".join("| " + " | ".join(line) + " |\n" for line in (head, ["---"] * len(head), *lines)).replace(
        "| " + " | ".join(["---"] * len(head)) + " |", "|" + "---|" * len(head)
    )


def number(value: float | str) -> str:
    """Three digits, or a dash where there is no value."""
    if isinstance(value, str):
        return value
    if not np.isfinite(value):
        return "–"
    return f"{value:.3g}" if value == 0.0 or 1e-3 <= abs(value) < 1e4 else f"{value:.1e}"


def cells(found: Mapping[str, float | str], keys: Iterable[str]) -> list[str]:
    """Cells of a row."""
    return [number(found[key]) for key in keys]


COLUMNS = {
    "tip_error_rms_mm": "tip RMS",
    "rcm_error_rms_mm": "RCM RMS",
    "rcm_error_max_mm": "RCM max",
    "torque_total_mean_nm": "total",
    "torque_peak_nm": "peak",
    "beyond_mean": "total beyond gravity",
    "beyond_peak": "peak beyond gravity",
    "torque_rate_median_nm_per_s": "rate",
}


@cache
def settings_runs() -> dict[tuple[str, str, str], dict[str, float | str]]:
    """Measured runs by arm, setting and controller."""
    keys = [(arm, setting, name) for arm in ARMS for setting in SETTINGS for name in CONTROLLERS]
    jobs = [Job(scenario=f"rcm_{setting}_{arm}", controller=name) for arm, setting, name in keys]
    return dict(zip(keys, many(jobs), strict=True))


def settings_table(arm: str) -> str:
    """The four settings on an arm with every controller."""
    lines = [
        [SETTINGS[setting], f"`{name}`", str(found["outcome"]), *cells(found, COLUMNS)]
        for (at, setting, name), found in settings_runs().items()
        if at == arm
    ]
    return table(["setting", "controller", "outcome", *COLUMNS.values()], lines)


def claims_table() -> str:
    """Torque of ours over that of each rival, smallest to largest over settings and arms."""
    keys = ("torque_total_mean_nm", "beyond_mean", "torque_peak_nm", "beyond_peak")
    lines = []
    for rival in RIVALS:
        done = [key[:2] for key, found in settings_runs().items() if key[2] == rival]
        done = [key for key in done if settings_runs()[*key, rival]["outcome"] == "completed"]
        row = [f"`{rival}`", f"{len(done)} of {len(ARMS) * len(SETTINGS)}"]
        for key in keys:
            ratios = [settings_runs()[*at, OURS][key] / settings_runs()[*at, rival][key] for at in done]
            row.append(f"{min(ratios):.3f} to {max(ratios):.3f}")
        lines.append(row)
    head = ["over", "completed", "total", "total beyond gravity", "peak", "peak beyond gravity"]
    return table(head, lines)


def port_table() -> str:
    """At a port in tissue and at one on a stand, with shares of the constraint's torque."""
    soft = (f"{LAW}tip_stiffness_per_s2=25.0", f"{LAW}rcm_stiffness_per_s2=50.0")
    ports = (("tissue", TISSUE, ()), ("tissue, soft gains", TISSUE, soft), ("stand, soft gains", STAND, soft))
    keys = [(arm, port, shares) for arm in ARMS for port in ports for shares in SHARES]
    jobs = [
        Job(
            scenario=f"rcm_spiral_{arm}",
            settings=(
                *wall,
                *gains,
                f"{LAW}constraint_share={shares[0]}",
                f"{LAW}constraint_bias_share={shares[1]}",
            ),
        )
        for arm, (_, wall, gains), shares in keys
    ]
    columns = {
        "tip_error_rms_mm": "tip RMS",
        "rcm_error_rms_mm": "RCM RMS",
        "trocar_force_rms_n": "port force RMS [N]",
        "trocar_force_max_n": "max [N]",
        "torque_total_mean_nm": "torque [N m]",
        "free": "free [N m]",
        "constraint": "constraint [N m]",
    }
    lines = []
    for (arm, (port, _, _), (s, b)), found in zip(keys, many(jobs), strict=True):
        done = found["outcome"] == "completed"
        said = cells(found, columns) if done else ["–"] * len(columns)
        lines.append([ARMS[arm], port, f"{s:g}, {b:g}", str(found["outcome"]), *said])
    return table(["arm", "port", "shares", "outcome", *columns.values()], lines)


GAINS = ((2e4, 1e4, 1.0), (4e3, 4e3, 1.0), (2e3, 2e3, 1.0), (1e3, 1e3, 0.7), (500.0, 500.0, 0.7))


def drives_table() -> str:
    """On real drives, spiral and theatre, over gains."""
    places = ("rcm_spiral_lwr4plus", "rcm_spiral_panda")
    places += ("theatre_lwr4plus", "theatre_panda", "theatre_fr3", "theatre_iiwa14")
    keys = [(place, gains) for gains in GAINS for place in places]
    jobs = [Job(scenario=place, settings=(*_gains(*gains), *_drives(place))) for place, gains in keys]
    found = dict(zip(keys, many(jobs), strict=True))
    lines = [
        [f"{gains[0]:g}, {gains[1]:g}, {gains[2]:g}", *(_errors(found[place, gains]) for place in places)]
        for gains in GAINS
    ]
    return table(["k_r, k_t, ζ", *(f"`{place}`" for place in places)], lines)


def _gains(rcm: float, tip: float, ratio: float) -> tuple[str, ...]:
    stiffness = (f"{LAW}rcm_stiffness_per_s2={rcm}", f"{LAW}tip_stiffness_per_s2={tip}")
    return (*stiffness, f"{LAW}rcm_damping_ratio={ratio}", f"{LAW}tip_damping_ratio={ratio}")


def _drives(place: str) -> tuple[str, ...]:
    return () if place.startswith("theatre") else ("robot.drive=real",)


def _errors(found: Mapping[str, float | str]) -> str:
    if found["outcome"] != "completed":
        return str(found["outcome"])
    return f"{number(found['tip_error_rms_mm'])} / {number(found['rcm_error_rms_mm'])}"


def same_motion_table() -> str:
    """Torque of M q'' for the same random accelerations of tip and RCM: ours over the unweighted one."""
    lines = []
    for arm, title in ARMS.items():
        setup = prepare(load_scenario(f"rcm_spiral_{arm}"))
        kin, dyn = setup.arm.evaluate(setup.q_start, np.zeros_like(setup.q_start))
        rcm = rcm_kinematics(kin, np.array(setup.scenario.trocar.position_m), np.zeros(3))
        M, J = dyn.mass_matrix, np.vstack([kin.Jv_WT, rcm.jacobian])
        weighted = np.linalg.solve(M, J.T) @ np.linalg.inv(J @ np.linalg.solve(M, J.T))
        a = np.random.default_rng(0).standard_normal((5, 10000))
        ours, plain = M @ weighted @ a, M @ np.linalg.pinv(J) @ a
        norms = np.linalg.norm(ours, axis=0) / np.linalg.norm(plain, axis=0)
        peaks = np.abs(ours).max(axis=0) / np.abs(plain).max(axis=0)
        lines.append([title, *(" / ".join(f"{x:.3f}" for x in _spread(ratio)) for ratio in (norms, peaks))])
    return table(["arm", "norm: least / median / most", "peak: least / median / most"], lines)


def _spread(ratio: np.ndarray) -> np.ndarray:
    return np.percentile(ratio, [0.0, 50.0, 100.0])


def projections_table() -> str:
    """Largest real part of the closed loop's poles with plain projectors, for three effective masses."""
    lines = []
    for arm, title in ARMS.items():
        setup = prepare(load_scenario(f"rcm_spiral_{arm}"))
        kin, dyn = setup.arm.evaluate(setup.q_start, np.zeros_like(setup.q_start))
        rcm = rcm_kinematics(kin, np.array(setup.scenario.trocar.position_m), np.zeros(3))
        M, J, A = dyn.mass_matrix, kin.Jv_WT, rcm.jacobian
        M_inv, P = np.linalg.inv(M), _projector(A)
        masses = (J @ M_inv @ J.T, J @ P @ M_inv @ P @ J.T, J @ M_inv @ P @ J.T)
        poles = [_slowest_pole(M, setup.arm.damping, J, A, np.linalg.inv(mass)) for mass in masses]
        lines.append([title, *(f"{pole:+.1f}" for pole in poles)])
    return table(["arm", "(J M⁻¹ Jᵀ)⁻¹", "(J P M⁻¹ P Jᵀ)⁻¹", "(J M⁻¹ P Jᵀ)⁻¹"], lines)


def _projector(A: np.ndarray) -> np.ndarray:
    return np.eye(A.shape[1]) - np.linalg.pinv(A) @ A


def _slowest_pole(
    M: np.ndarray, damping: np.ndarray, J: np.ndarray, A: np.ndarray, mass: np.ndarray
) -> float:
    """Largest real part [1/s] with the gains of constraint_consistent, linearised at rest."""
    M_inv, one, zero = np.linalg.inv(M), np.eye(len(M)), np.zeros_like(M)
    shaft, below = A.T @ np.linalg.inv(A @ M_inv @ A.T) @ A, _projector(A) @ J.T @ mass
    posture = _projector(np.vstack([J, A])) @ M

    def torque(rcm: float, tip: float, joint: float) -> np.ndarray:
        return rcm * shaft + below @ (tip * J - rcm * J @ M_inv @ shaft) + joint * posture

    stiffness, damped = torque(2e4, 1e4, 100.0), torque(2.0 * 2e4**0.5, 200.0, 20.0) + np.diag(damping)
    loop = np.block([[zero, one], [-M_inv @ stiffness, -M_inv @ damped]])
    return float(np.linalg.eigvals(loop).real.max())


TABLES: dict[str, Callable[[], str]] = {
    "settings_lwr4plus": lambda: settings_table("lwr4plus"),
    "settings_panda": lambda: settings_table("panda"),
    "claims": claims_table,
    "projections": projections_table,
    "same_motion": same_motion_table,
    "port": port_table,
    "drives": drives_table,
}
"""Every table of the page."""


def main(names: Sequence[str]) -> int:
    """Write the tables `names` into the page; all without names."""
    if unknown := set(names) - set(TABLES):
        print(f"no such table: {', '.join(sorted(unknown))}; known: {', '.join(TABLES)}", file=sys.stderr)
        return 2
    text = PAGE.read_text(encoding="utf-8")
    for name in names or TABLES:
        marked = rf"(<!-- made {name} -->\n\n).*?(\n<!-- end -->)"
        made = TABLES[name]()
        text, count = re.subn(marked, lambda match, made=made: match[1] + made + match[2], text, flags=re.S)
        if count != 1:
            print(f"{PAGE} has {count} places for the table {name}", file=sys.stderr)
            return 1
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
