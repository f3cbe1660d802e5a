"""The page of the passive teleoperation study: its figures, and what is written between them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from surgsim.studies.figure import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILLION, Axes, label
from surgsim.studies.passive_teleoperation.cases import GRIPS, PAPER, PASSIVITY
from surgsim.studies.passive_teleoperation.measures import REST_MM_PER_S, UNSTABLE
from surgsim.studies.study import Figure, Results, Section
from surgsim.studies.tables import Cell, Row, Tables, number, numbers, pick

FLOOR_J = 0.01
_BANDS = (
    ("planes", ORANGE, "a plane acts"),
    ("budget", VERMILLION, "the energy budget acts"),
    ("scaled", PURPLE, "the operator's tank limits the force"),
    ("speed", GREEN, "command above the speed limit"),
)
_COLOURS = {"tank": BLUE, "tdpa": GREEN, "off": VERMILLION}
_STYLES = {"tank": "-", "tdpa": "-", "off": "--"}
_WIDTHS = {"tank": 2.4, "tdpa": 0.7, "off": 1.2}
_OFFSETS_MS = {"tank": -12.0, "tdpa": 0.0, "off": 12.0}
_TIME = "time (s)"


_LINES: tuple[tuple[str, str, Cell], ...] = (
    ("RCM error, RMS (mm)", "rcm_rms_mm", PAPER["rcm_rms"]),
    ("RCM error, largest (mm)", "rcm_max_mm", None),
    ("velocity error, aligned (mm/s)", "velocity_aligned_mm_per_s", PAPER["velocity_rms"]),
    ("velocity error, not aligned (mm/s)", "velocity_unaligned_mm_per_s", PAPER["velocity_rms"]),
    ("velocity error, all ticks (mm/s)", "velocity_all_ticks_mm_per_s", PAPER["velocity_rms"]),
    ("lowest tank (J)", "tank_min_j", None),
    ("largest slack (mm/s)", "slack_max_mm_per_s", None),
    ("largest slack, nothing active (mm/s)", "slack_free_max_mm_per_s", None),
    ("a plane acts (% of ticks)", "planes_percent", None),
    ("times that a plane began to act", "plane_contacts", None),
    ("tip past a plane (mm)", "plane_overshoot_mm", None),
    ("command above the speed limit (% of ticks)", "speed_limit_percent", None),
    ("speed limit of an axis (mm/s)", "tip_speed_limit_mm_per_s", None),
    ("fastest tip along an axis (mm/s)", "tip_speed_max_mm_per_s", None),
    ("the energy budget acts (% of ticks)", "passivity_percent", None),
    ("the operator's tank limits the force (% of ticks)", "force_scaled_percent", None),
    ("rings transferred", "rings_transferred", None),
    ("rings dropped", "ring_drops", None),
    ("unexplained energy (% of exchanged)", "energy_residual_percent", None),
    ("duration (s)", "duration_s", None),
)


def beside_the_paper(scenarios: Sequence[Row]) -> list[Row]:
    """One line for each figure: the paper's, then ours in every scenario."""
    return [
        {"figure": words, "paper": paper, **{str(row["scenario"]): row[column] for row in scenarios}}
        for words, column, paper in _LINES
    ]


def _tracking(axes: Axes, results: Results, _: Tables) -> None:
    """Velocity along x in free motion, and the RCM error of every scenario."""
    shipped, (top, bottom) = results["shipped"], axes[:, 0]
    free, inside = shipped[0].curves, {"frameon": False, "fontsize": 10, "loc": "upper right", "ncols": 3}
    lines = (
        ("v_issued", ORANGE, 1.2, "master now"),
        ("v_command", BLACK, 3.0, "command that has arrived"),
        ("v_tip", BLUE, 1.2, "tip"),
    )
    for name, colour, width, words in lines:
        top.plot(free["t"], 1e3 * free[name], color=colour, linewidth=width, label=words)
    top.set(xlabel=_TIME, title="free motion, 300 ms round trip")
    top.legend(**inside)
    for found, colour in zip(shipped, (BLUE, GREEN, VERMILLION, PURPLE), strict=True):
        style: dict[str, Any] = {"color": colour, "label": found.case.label, "linewidth": 1.0}
        bottom.semilogy(found.curves["t"], 1e3 * found.curves["rcm"], **style)
    bottom.axhline(PAPER["rcm_rms"], color=BLACK, linestyle="--", linewidth=1.0, label="the paper's RMSE")
    bottom.legend(**inside)
    bottom.set_ylim(1e-6, 100.0)
    label(axes, _TIME, ["velocity along x (mm/s)", "RCM error (mm)"])


def _tanks(axes: Axes, results: Results, _: Tables) -> None:
    """Both tanks over time, one panel for each scenario."""
    for ax, found in zip(axes.flat, results["shipped"], strict=True):
        t = found.curves["t"]
        ax.plot(t, found.curves["tank_operator"], color=BLUE, label="operator's tank")
        ax.plot(t, found.curves["tank_remote"], color=VERMILLION, label="remote tank", linestyle="--")
        ax.axhline(FLOOR_J, color=BLACK, linewidth=1.0, linestyle=":", label="floor")
        ax.set(title=found.case.label, xlabel=_TIME)
    axes[0, 0].set_ylim(0.0, None)
    label(axes, ylabels=2 * ["energy (J)"], legend=3)


def _constraints(axes: Axes, results: Results, _: Tables) -> None:
    """Slack over time, with a bar above the curve wherever a constraint acts."""
    for ax, found in zip(axes.flat, results["shipped"], strict=True):
        t, curves, across = found.curves["t"], found.curves, ax.get_xaxis_transform()
        ax.semilogy(t, 1e3 * curves["slack"] + 1e-6, color=BLUE, label="slack", linewidth=1.2)
        for i, (name, colour, words) in enumerate(_BANDS):
            style: dict[str, Any] = {"where": curves[name] > 0.0, "color": colour, "label": words}
            low = 0.95 - 0.06 * i
            ax.fill_between(t, low, low + 0.05, linewidth=0.8, transform=across, **style)
        ax.set(title=found.case.label, xlabel=_TIME, ylim=(1e-5, 3e4))
        ax.set_yticks([1e-5, 1e-3, 1e-1, 1e1])
    label(axes, ylabels=2 * ["slack of the tip's velocity (mm/s)"], legend=3)


def _comparison(axes: Axes, results: Results, _: Tables) -> None:
    """The wall at 300 ms over time; the passivity controller's chatter is drawn below the others."""
    rows = (("force", 1.0), ("felt", 1.0), ("handle_speed", 1e3), ("delivered", 1.0))
    shown = [found for found in results["pushes"] if found.case.compared and found.case.place == "wall"]
    for found in sorted(shown, key=lambda found: found.case.passivity != "tdpa"):
        name, column = found.case.passivity, axes[:, GRIPS.index(found.case.grip)]
        style: dict[str, Any] = {"color": _COLOURS[name], "label": name, "linewidth": _WIDTHS[name]}
        for ax, (key, factor) in zip(column, rows, strict=True):
            ax.plot(found.curves["t"], factor * found.curves[key], _STYLES[name], **style)
        column[2].set_yscale("log")
        column[3].set_yscale("symlog", linthresh=0.1)
    for ax in axes[2]:
        ax.set_ylim(bottom=0.1)
    words = ["contact force (N)", "force on the handle (N)", "speed of the handle (mm/s)"]
    ylabels = [*words, "energy delivered (J), symlog"]
    label(axes, _TIME, ylabels, [f"{grip} grip" for grip in GRIPS], legend=3)


def _sweep(axes: Axes, _: Results, tables: Tables) -> None:
    """The wall over the delay: handle speed at the end and energy delivered; crosses are unstable."""
    wall, columns = pick(tables["pushes"], place="wall"), ("handle_speed_end_mm_per_s", "delivered_max_j")
    for line, column in zip(axes, columns, strict=True):
        for ax, grip in zip(line, GRIPS, strict=True):
            for passivity in PASSIVITY:
                _sweep_points(ax, pick(wall, grip=grip, passivity=passivity), column, passivity)
    for ax in axes[0]:
        ax.set_yscale("log")
        ax.axhline(REST_MM_PER_S, color=BLACK, linewidth=1.0, linestyle=":")
    for ax in axes[1]:
        ax.set_yscale("symlog", linthresh=1e-2)
        ax.axhline(0.4, color=BLACK, linewidth=1.0, linestyle=":")
        ax.set_ylim(-0.01, 20.0)
    words = ["handle speed at the end (mm/s)", "largest energy delivered (J)"]
    label(axes, "round trip (ms)", words, [f"{grip} grip" for grip in GRIPS], legend=3)


def _sweep_points(ax: Axes, rows: list[Row], column: str, passivity: str) -> None:
    shift, colour, clean = _OFFSETS_MS[passivity], _COLOURS[passivity], pick(rows, link="clean")
    delays = np.array(numbers(clean, "delay_ms")) + shift
    ax.plot(delays, numbers(clean, column), _STYLES[passivity], color=colour, linewidth=1.3, label=passivity)
    for row in rows:
        marker = "X" if row["end"] in UNSTABLE else "o"
        fill = {"markerfacecolor": colour if row["link"] == "clean" else "none", "markeredgecolor": colour}
        ax.plot(number(row, "delay_ms") + shift, number(row, column), marker, markersize=7, **fill)


_CONSTRAINTS = "Slack and active constraints over time"
_PUSH_TITLE = "Push on a stiff wall, 300 ms round trip"
_DELAY_TITLE = (
    "Push on a stiff wall over the round trip: dots settle, crosses do not; hollow: jitter and loss"
)
FIGURES = (
    Figure("tracking.png", "Velocity in free motion, and RCM error", _tracking, (2, 1), (11.0, 7.0)),
    Figure("tanks.png", "Energy tanks over time", _tanks, (2, 2), (11.0, 7.0), (False, True)),
    Figure("constraints.png", _CONSTRAINTS, _constraints, (2, 2), (11.0, 7.5), (False, True)),
    Figure("comparison.png", _PUSH_TITLE, _comparison, (4, len(GRIPS)), (11.0, 11.0), ("col", False)),
    Figure("sweep.png", _DELAY_TITLE, _sweep, (2, 2), (11.0, 8.0), (True, "row")),
)

INTRODUCTION = """\
"{title}" ({reference}): a Panda through a trocar, driven from a master console through a round trip of
300 ms, with a QP that holds the RCM, an energy budget and the workspace's limits. The paper's arm and
person are real, ours are simulated, and the paper publishes neither its gains nor its tanks; what was chosen
is in [docs/teleoperation.md](../../docs/teleoperation.md). Everything here is made again by

    {command}

with {versions}. The CSV files hold every table with nine digits;
`scenarios.csv` and `scenarios_real.csv` are the first two tables on their side, and `pushes.csv`, one row for
every push, is not shown."""
_SCENARIOS = """## The paper's scenarios

The shipped `teleop_free_motion_panda`, `teleop_workspace_limits_panda`, `teleop_wall_panda` (with 5 ms jitter
and 10 % loss each way) and `peg_and_ring_panda`, seed 0. Velocity errors are RMS: `aligned` against the
command that has arrived, `not aligned` against what the master does now, both while no constraint acts and
nothing is touched; `all ticks` is aligned, with contact and constraints. The paper's figures are of a task
with pegs and rings."""
_REAL = """## The same on real drives

The paper's arm is a real one: these are the figures to put beside its own. The drives are elastic, with
friction on the motors. The law above does not know of them, so this is `passive_elastic`, ours, with each
scenario's own workspace: the same program, its command behind the energy budget, over a law for drives."""
_COMPARISON_TEXT = """## Tank, passivity controller, nothing

One push through a clean round trip of 300 ms: the hand moves aside, then to 15 mm below the wall's surface,
and holds; without the wall (`free`) the tip follows. A light grip is 20 N/m and 1 N s/m and pushes for 10 s
and 4 round trips, a normal one is 135 N/m and 6.45 N s/m and pushes for 6 s and 4 round trips. `delivered
max` is the largest net energy that hand and surroundings got; `beyond stock` is that less what the tanks held
at first. `end` says how it ends, from the last two windows of 2 s:

- rests: the handle below 5 mm/s RMS and the contact force steady (deviation below 0.5 N or 5 % of its mean);
- chatters: the handle rests, the contact force does not;
- decays: the handle moves, at most 0.8 times as fast as in the window before;
- oscillates, grows: it moves and does not decay (grows: at least 1.05 times as fast);
- runs away: it moves at 150 mm/s or more, as fast as the operator ever means to, who means to rest;
- stopped: a safety limit was passed.

The last three lines count as unstable. `force ratio` is the mean force on the handle over the mean contact
force; `passivity percent` is how long the energy budget limits the tip, `force scaled percent` how long
the operator's tank limits the force; `drift end` is how far the tip is from where the master, as received,
says."""
_FRONTIER = """## Where it becomes unstable

The same push over the round trip. Lossy means 10 ms jitter and 10 % loss each way: seed 0, in the light
grip at 300 ms the worst of three seeds. The operator expects the delay that there is. Without passivity the
handle hangs on a spring to its own delayed position: the grip alone damps that."""
_GUARDED = """## Where the energy row acts

Two runs whose remote tank is drawn on: the tip led through viscous tissue (60 N s/m, the shipped
`teleop_tissue_panda`) with 0.03 J in each tank, and a stiff hand that throws the tip at the wall with 0.012
J. `row` is the paper's program; `nothing` is the same without its row, the operator's tank left; `valve` is
`passive_kinetic`, ours. `deficit` is what was taken from empty tanks."""
_TIMING = """## Time of a tick

Of one machine, in one process after the other runs, and of whatever else ran then: not reproducible."""
_COLUMNS = (
    "place",
    "grip",
    "passivity",
    "end",
    "handle_speed_end_mm_per_s",
    "contact_force_n",
    "contact_deviation_n",
    "contact_max_n",
    "master_force_n",
    "force_ratio",
    "drift_end_mm",
    "delivered_max_j",
    "beyond_stock_j",
    "tank_min_j",
    "passivity_percent",
    "force_scaled_percent",
    "rcm_rms_mm",
)

SECTIONS = (
    Section(_SCENARIOS, "paper", ("tracking.png", "tanks.png", "constraints.png")),
    Section(_REAL, "paper_real"),
    Section(_COMPARISON_TEXT, "comparison", ("comparison.png",), columns=_COLUMNS),
    Section(_FRONTIER, "frontier", ("sweep.png",)),
    Section(_GUARDED, "guarded"),
    Section(_TIMING, "timing"),
)
