"""The map: a row for each scheme and place, with its interval; who is best where; how often each is good."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from surgsim.studies.tables import Cell, Row, groups, number, numbers, pick

CONFIDENCE = 0.95
NETWORK = ("surroundings", "grip", "loss", "jitter_ms")
PLACE = (*NETWORK, "delay_ms")
"""Columns that say what is pushed on, by which hand, through what."""


def interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Mean and the ends of its 95 % interval, of Student's distribution; infinite of one value alone."""
    found = np.array(values, dtype=float)
    mean = float(found.mean())
    if found.size < 2:
        return mean, -math.inf, math.inf
    half = student.ppf(0.5 + CONFIDENCE / 2.0, found.size - 1) * found.std(ddof=1) / math.sqrt(found.size)
    return mean, mean - float(half), mean + float(half)


def map_table(pushes: Sequence[Row]) -> list[Row]:
    """A row for each place and scheme: in how many seeds it is passive and rests, and its mismatch."""
    keys = (*PLACE, "scheme")
    table: list[Row] = []
    for key, rows in groups(pushes, *keys).items():
        felt = [number(row, "mismatch") for row in rows if row["mismatch"] is not None]
        mean, low, high = interval(felt) if len(felt) == len(rows) else (math.nan, math.nan, math.nan)
        table.append(
            {
                **dict(zip(keys, key, strict=True)),
                "seeds": len(rows),
                "passive": round(sum(numbers(rows, "passive"))),
                "rests": round(sum(numbers(rows, "rests"))),
                "excess_max_mj": 1e3 * max(numbers(rows, "excess_j")),
                "contact_force_n": float(np.mean(numbers(rows, "contact_force_n"))),
                "mismatch": None if math.isnan(mean) else mean,
                "mismatch_low": None if math.isnan(mean) else low,
                "mismatch_high": None if math.isnan(mean) else high,
                "drift_mm": float(np.mean(numbers(rows, "drift_mm"))),
            }
        )
    return table


def is_passive(row: Row) -> bool:
    """Whether a scheme is passive at a place with every seed."""
    return row["passive"] == row["seeds"]


def is_at_rest(row: Row) -> bool:
    """Whether it rests there with every seed."""
    return row["rests"] == row["seeds"]


def is_good(row: Row) -> bool:
    """Whether it does both."""
    return is_passive(row) and is_at_rest(row)


def qualified(rows: Sequence[Row]) -> list[Row]:
    """Schemes that are passive and rest with every seed, and press; most transparent first."""
    good = [row for row in rows if is_good(row) and row["mismatch"] is not None]
    return sorted(good, key=lambda row: number(row, "mismatch"))


MATTERS, PRESS_SHARE = 0.05, 0.5
"""A smaller difference of mismatch counts for nothing; who is best presses at least so much of the median."""


def winners_table(table: Sequence[Row]) -> list[Row]:
    """Who is best at each place: the smallest mismatch of those that qualify and press like most of them.

    Not told from it is whose interval reaches into its own, or whose mismatch is less than `MATTERS` larger.
    """
    found: list[Row] = []
    for place, rows in groups(table, *PLACE).items():
        good = qualified(rows)
        row: dict[str, Cell] = {
            **dict(zip(PLACE, place, strict=True)),
            "qualified": len(good),
            "best": "none",
        }
        row |= {"mismatch": None, "mismatch_low": None, "mismatch_high": None, "not_told_apart": ""}
        if good:
            enough = PRESS_SHARE * float(np.median(numbers(good, "contact_force_n")))
            best, *others = [each for each in good if number(each, "contact_force_n") >= enough]
            near = [
                each
                for each in others
                if number(each, "mismatch_low") <= number(best, "mismatch_high")
                or number(each, "mismatch") < number(best, "mismatch") + MATTERS
            ]
            row["best"] = best["scheme"]
            row |= {key: best[key] for key in ("mismatch", "mismatch_low", "mismatch_high")}
            row["not_told_apart"] = ", ".join(str(each["scheme"]) for each in near)
        found.append(row)
    return found


def best_table(winners: Sequence[Row]) -> list[Row]:
    """The winners with the delays side by side: the best, and how many are not told from it."""
    found: list[Row] = []
    for place, rows in groups(winners, *NETWORK).items():
        row: dict[str, Cell] = dict(zip(NETWORK, place, strict=True))
        for winner in rows:
            near = str(winner["not_told_apart"])
            others = f" +{near.count(',') + 1}" if near else ""
            row[f"{number(winner, 'delay_ms'):g} ms"] = f"{winner['best']}{others}"
        found.append(row)
    return found


def schemes_table(table: Sequence[Row], winners: Sequence[Row]) -> list[Row]:
    """In how many places each scheme is passive, rests, qualifies and is best, and its worst excess."""
    found: list[Row] = []
    for (scheme,), rows in groups(table, "scheme").items():
        first = pick(winners, best=scheme)
        near = [row for row in winners if str(scheme) in str(row["not_told_apart"]).split(", ")]
        found.append(
            {
                "scheme": scheme,
                "places": len(rows),
                "passive": sum(map(is_passive, rows)),
                "rests": sum(map(is_at_rest, rows)),
                "qualified": len(qualified(rows)),
                "best": len(first),
                "best_or_not_told_apart": len(first) + len(near),
                "excess_max_mj": max(numbers(rows, "excess_max_mj")),
            }
        )
    return found


def z_width_table(renders: Sequence[Row]) -> list[Row]:
    """A row for each scheme and delay: what is felt of free motion and of the wall, means over the seeds."""
    found: list[Row] = []
    for (scheme, delay), rows in groups(renders, "scheme", "delay_ms").items():
        free, wall = pick(rows, wall=False), pick(rows, wall=True)
        stiffness = [row["stiffness_n_per_m"] for row in wall]
        found.append(
            {
                "scheme": scheme,
                "delay_ms": delay,
                "seeds": len(wall),
                "passive": min(round(sum(numbers(each, "passive"))) for each in (free, wall)),
                "free_damping_ns_per_m": float(np.mean(numbers(free, "damping_ns_per_m"))),
                "free_impedance_ns_per_m": float(np.mean(numbers(free, "impedance_ns_per_m"))),
                "wall_stiffness_n_per_m": None
                if None in stiffness
                else float(np.mean(numbers(wall, "stiffness_n_per_m"))),
            }
        )
    return found


def rendered_table(z_widths: Sequence[Row]) -> list[Row]:
    """The same with the delays side by side: free motion, wall, and `!` where it is not passive."""
    found: list[Row] = []
    for (scheme,), rows in groups(z_widths, "scheme").items():
        row: dict[str, Cell] = {"scheme": scheme}
        for place in rows:
            stiffness = place["wall_stiffness_n_per_m"]
            wall = "-" if stiffness is None else f"{stiffness:.3g}"
            mark = "" if is_passive(place) else " !"
            row[f"{number(place, 'delay_ms'):g} ms"] = (
                f"{number(place, 'free_impedance_ns_per_m'):.2g}, {wall}{mark}"
            )
        found.append(row)
    return found


def worst_excess(table: Sequence[Row], scheme: str) -> float:
    """Largest energy of a scheme beyond its stock, over all places [mJ]."""
    return max(numbers(pick(table, scheme=scheme), "excess_max_mj"))
