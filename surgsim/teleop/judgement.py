"""What a teleoperated run was worth beside its goals: passive, at rest, faithful.

All from a run's columns, as a function of them alone.
"""

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.teleop.console import JOINTS

PASSIVE_J = 1e-3
"""Energy delivered beyond what was stored, up to which a run is called passive [J]."""
REST_M_PER_S = 0.02
"""Speed of handle and tip up to which they rest at the end [m/s]."""
CHATTER_PER_S = 10.0
"""Beginnings and ends of contact in the last second, from which on it chatters."""
CONTACT_N = 0.1
"""A contact begins with more than this at the tip [N]."""
NO_CONTACT_N = 1e-3
"""And it ends with less than this [N]: a viscous medium that the tip hardly moves in is not left."""
_END_S = 0.5


class Columns(Protocol):
    """A run's rows, by column: what a trace offers."""

    def __len__(self) -> int: ...

    def __contains__(self, block: str) -> bool: ...

    def __getitem__(self, column: str) -> Array: ...

    def block(self, name: str) -> Array:
        """A block's columns (rows, width)."""
        ...


def excess_j(run: Columns) -> float:
    """Largest energy that hand and surroundings got, less what tanks and channels held at first [J].

    A passive teleoperator keeps it at or below 0. Without tanks nothing is stored, and their columns are 0.
    """
    stored = float(run["tank_operator_j"][0] + run["tank_remote_j"][0] + run["in_flight_j"][0])
    return float(np.nanmax(run["delivered_j"])) - stored


def toggles_per_s(run: Columns) -> float:
    """Most beginnings and ends of contact at the tip within a second; NaN where nothing can touch it."""
    if "tip_force" not in run or len(run) < 2:
        return math.nan
    times = run["t_s"][1:][np.diff(_touches(run).astype(int)) != 0]
    return float(max((np.searchsorted(times, t + 1.0) - k for k, t in enumerate(times)), default=0))


def _touches(run: Columns) -> NDArray[np.bool_]:
    force = np.linalg.norm(run.block("tip_force"), axis=1)
    told = (force > CONTACT_N) | (force < NO_CONTACT_N)
    last_told = np.maximum.accumulate(np.where(told, np.arange(len(force)), 0))
    touches: NDArray[np.bool_] = force[last_told] > CONTACT_N
    return touches


def end_speed(run: Columns) -> float:
    """Largest speed of handle or tip in the last half second [m/s]."""
    t = run["t_s"]
    last = np.flatnonzero(t >= t[-1] - _END_S)
    handle = np.linalg.norm(run.block("handle_velocity")[last], axis=1)
    if last.size < 2:
        return float(handle.max())
    tip = np.linalg.norm(np.gradient(run.block("tip")[last], t[last], axis=0), axis=1)
    return float(max(handle.max(), tip.max()))


def ends(run: Columns) -> str:
    """How the motion ends: `rests`, `chatters`, `grows` or `moves` on."""
    t = run["t_s"]
    if "tip_force" in run:
        last = _touches(run)[t >= t[-1] - 1.0]
        if np.count_nonzero(np.diff(last.astype(int))) >= CHATTER_PER_S:
            return "chatters"
    if end_speed(run) <= REST_M_PER_S:
        return "rests"
    speed = np.linalg.norm(run.block("handle_velocity"), axis=1)
    late, before = speed[t >= t[-1] - 1.0], speed[(t < t[-1] - 1.0) & (t >= t[-1] - 2.0)]
    return "grows" if before.size and late.max() > 1.1 * before.max() else "moves"


def drift(run: Columns) -> float:
    """How far the tip is from where the master points, as received, at the end [m]."""
    return float(np.linalg.norm(run.block("tip")[-1] - run.block("tip_ref")[-1]))


def force_fidelity(run: Columns, late_s: float) -> float:
    """Correlation of the size of the rendered force with that of the tip, `late_s` [s] before, from -1 to 1.

    NaN where nothing was touched.
    """
    if "tip_force" not in run:
        return math.nan
    late = round(late_s / (run["t_s"][1] - run["t_s"][0])) if len(run) > 1 else 0
    tip = np.linalg.norm(run.block("tip_force"), axis=1)[: len(run) - late]
    hand = np.linalg.norm(run.block("master_force"), axis=1)[late:]
    if tip.size < 2 or tip.std() == 0.0 or hand.std() == 0.0:
        return math.nan
    return float(np.corrcoef(tip, hand)[0, 1])


def transmitted_impedance(run: Columns, late_s: float) -> tuple[float, float]:
    """Stiffness [N/m] and damping [N s/m] that the hand feels while it knows of a contact.

    The least-squares fit of -F = K (x - x_c) + B v over the ticks whose contact began `late_s` [s] before or
    earlier, with rendered force F, handle position x and velocity v, and a place x_c of no force for each
    contact. NaN with less than a tenth of a second of it.
    """
    if "tip_force" not in run or len(run) < 2:
        return math.nan, math.nan
    touches, period = _touches(run), float(run["t_s"][1] - run["t_s"][0])
    edges = np.flatnonzero(np.diff(np.concatenate(([False], touches, [False])).astype(int)))
    late, names = round(late_s / period), ("handle", "handle_velocity", "master_force")
    rows: list[list[Array]] = [[], [], []]
    for begin, end in zip(edges[::2] + late, edges[1::2], strict=True):
        if end - begin >= 2:
            for found, name in zip(rows, names, strict=True):
                values = run.block(name)[begin:end]
                found.append((values - values.mean(axis=0)).ravel())
    if sum(each.size for each in rows[0]) * period < 0.3:
        return math.nan, math.nan
    x, v, force = (np.concatenate(each) for each in rows)
    fit = np.linalg.lstsq(np.column_stack([x, v]), -force, rcond=None)[0]
    return float(fit[0]), float(fit[1])


def stuck(run: Columns, goal: Array | None = None) -> str:
    """What kept the operator from a goal when time was up, in words; empty where nothing shows.

    The handle on its stop at the end or for a second in all, a dead link, the tip pressing on something, and
    else how far the tip is from `goal` (3,) [m].
    """
    stops = run["handle_stop"].astype(int) if "handle_stop" in run else np.zeros(len(run), dtype=int)
    period = float(np.median(np.diff(run["t_s"]))) if len(run) > 1 else 0.0
    held_s = period * np.count_nonzero(stops)
    if stops[-1] > 0 or held_s >= 1.0:
        joint = JOINTS[np.bincount(stops[stops > 0]).argmax() - 1]
        return f"the handle was on the stop of the console's {joint} joint for {held_s:.3g} s"
    if "setpoint_trust" in run and run["setpoint_trust"][-1] == 0.0:
        return "nothing arrives at the remote side"
    if "tip_force" in run and _touches(run)[-1]:
        return f"the tip presses on something with {np.linalg.norm(run.block('tip_force')[-1]):.3g} N"
    if goal is None or "tip" not in run:
        return ""
    return f"the tip is {1e3 * np.linalg.norm(run.block('tip')[-1] - goal):.3g} mm from it"


def faults(run: Columns) -> list[str]:
    """What speaks against a run whose goals were reached, in words: it gave out energy, or is not at rest."""
    found = []
    excess = excess_j(run)
    if excess > PASSIVE_J:
        found.append(f"it was active: it delivered {1e3 * excess:.3g} mJ more than it had stored")
    how = ends(run)
    if how != "rests":
        found.append(f"it {how} at the end, at {1e3 * end_speed(run):.3g} mm/s")
    return found
