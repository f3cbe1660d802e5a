"""README.md of the study's result folder."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from surgsim.studies.page import claims_table, pictures, versions
from surgsim.studies.study import Claim, Row, markdown_table

Tables = Mapping[str, Sequence[Row]]

INTRODUCTION = """# Passive convex teleoperation paper: reproduction

"A Passive Convex Optimal Control Algorithm for Teleoperating a Redundant Robotic Arm in Minimally Invasive
Surgery" (doi 10.1002/rnc.7613): a Panda through a trocar, driven from a master console through a round trip
of 300 ms, with a QP that holds the RCM, an energy budget and the workspace's limits. The paper's arm and
person are real, ours are simulated, and the paper publishes neither its gains nor its tanks; what was chosen
is in [docs/teleoperation.md](../../docs/teleoperation.md). Everything here is made again by

    {command}

with {versions}. The CSV files hold every table with nine digits;
`scenarios.csv` is the first table on its side, and `pushes.csv`, one row for every push, is not shown."""

SCENARIOS = """## The paper's scenarios

The shipped `teleop_free_motion_panda`, `teleop_workspace_limits_panda`, `teleop_wall_panda` (with 5 ms jitter
and 10 % loss each way) and `peg_and_ring_panda`, seed 0. Velocity errors are RMS: `aligned` against the
command that has arrived, `not aligned` against what the master does now, both while no constraint acts and
nothing is touched; `all ticks` is aligned, with contact and constraints. The paper's figures are of a task
with pegs and rings."""

COMPARISON = """## Tank, passivity controller, nothing

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

FRONTIER = """## Where it becomes unstable

The same push over the round trip. Lossy means 10 ms jitter and 10 % loss each way: seed 0, in the light
grip at 300 ms the worst of three seeds. The operator expects the delay that there is. Without passivity the
handle hangs on a spring to its own delayed position: the grip alone damps that."""

TIMING = """## Time of a tick

Of one machine, in one process after the other runs, and of whatever else ran then: not reproducible."""


def write_report(
    path: Path, tables: Tables, claims: Sequence[Claim], figures: Sequence[str], *, quick: bool
) -> None:
    """Write the page: command, versions, claims, tables, figures."""
    command = "surgsim reproduce passive_teleoperation" + (" --quick" if quick else "")
    parts = [INTRODUCTION.format(command=command, versions=versions())]
    if quick:
        parts.append("This is a quick run: shortened scenarios and a sample of the pushes, without figures.")
    parts += ["## Claims", claims_table(claims), SCENARIOS, markdown_table(tables["paper"])]
    parts += pictures(figures, ["tracking.png", "tanks.png", "constraints.png"])
    parts += [COMPARISON, markdown_table([_shown(row) for row in tables["comparison"]])]
    parts += pictures(figures, ["comparison.png"])
    parts += [FRONTIER, markdown_table(tables["frontier"]), *pictures(figures, ["sweep.png"])]
    if "timing" in tables:
        parts += [TIMING, markdown_table(tables["timing"])]
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


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


def _shown(row: Row) -> Row:
    return {key: row[key] for key in _COLUMNS}
