"""Rows compared: by how much one is better than another, and whether two can be told apart."""

from collections.abc import Mapping, Sequence

from surgsim.studies.study import Judged, in_all
from surgsim.studies.tables import Row, Tables, groups, number, pick

Criteria = Sequence[tuple[str, str, float]]
"""Column, words, and whether more (1) or less (-1) is better."""


def better(row: Row, other: Row, criteria: Criteria) -> dict[str, float]:
    """By how much `row` is better in each criterion, as a share of `other`'s figure."""
    return {
        words: sign * (number(row, column) / number(other, column) - 1.0) for column, words, sign in criteria
    }


def percent(gain: Mapping[str, float]) -> str:
    """Shares by their words, as percents with a sign."""
    return ", ".join(f"{words} {100.0 * value:+.2f} %" for words, value in gain.items())


def told_apart(row: Row, other: Row, columns: Sequence[str], share: float, least: float) -> bool:
    """Whether a column differs by more than `share` of `other`'s figure, and by more than `least`."""
    pairs = [(number(row, column), number(other, column)) for column in columns]
    return any(abs(a - b) > max(share * abs(b), least) for a, b in pairs)


SEEN, SHARE, LEAST_MM = ("tip_rms_mm", "rcm_rms_mm"), 0.1, 1e-3
"""What must differ for two resolvers to be told apart, by which share, and by how much [mm]."""


def told_table(every: Sequence[Row], base: str, rival: str) -> list[Row]:
    """For each torque law and duration: which resolvers can be told from `base`, and how far `rival` is off.

    Args:
        every: A row for each resolver over each law.
        base: The controller that the others are compared with.
        rival: The one whose differences are shown.
    """
    table: list[Row] = []
    for (law, at, duration), rows in groups(every, "torque_law", "evaluated_at", "duration_s").items():
        by_name = {str(row["controller"]): row for row in rows}
        one, other = by_name.pop(base), by_name[rival]
        told = [name for name, row in by_name.items() if told_apart(row, one, SEEN, SHARE, LEAST_MM)]
        columns = (("tip", "tip_rms_mm"), ("rcm", "rcm_rms_mm"), ("mu", "mu_mean"))
        off = {name: 100.0 * (number(other, c) / number(one, c) - 1.0) for name, c in columns}
        table.append(
            {
                "torque_law": law,
                "evaluated_at": at,
                "duration_s": duration,
                **{name: one[name] for name in SEEN},
                **{f"{rival.lower()}_{name}_percent": value for name, value in off.items()},
                f"{rival.lower()}_told": "yes" if rival in told else "no",
                "told_from_it": ", ".join(told) or "none",
                "not_told": ", ".join(name for name in by_name if name not in told) or "none",
            }
        )
    return table


def judge_told(shown: str, rival: str, tables: Tables) -> Judged:
    """Over which of the `laws` the rival can be told from the base; one law's figures are shown."""
    rows = tables["laws"]
    told = [row for row in rows if row[f"{rival}_told"] == "yes"]
    cells = (f"{row['torque_law']} ({row['evaluated_at']}, {row['duration_s']:g} s)" for row in told)
    (one, *_) = pick(rows, torque_law=shown)
    off = " and ".join(f"{number(one, f'{rival}_{name}_percent'):+.2f}" for name in ("tip", "rcm"))
    return in_all([row in told for row in rows]), (
        f"in {len(told)} of {len(rows)} cells: {', '.join(cells) or 'none'}; over {shown} its RMS errors are "
        f"{off} % off"
    )
