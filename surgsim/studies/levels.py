"""What an arm has and its controller's model does not: payload and friction, and ladders of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal, NamedTuple

import numpy as np

from surgsim.display import count
from surgsim.studies.figure import Axes, heat_map, label
from surgsim.studies.study import Judged, Results, holds
from surgsim.studies.tables import Row, Tables, number, numbers, pick, span

Drive = Literal["ideal", "real"]


@dataclass(frozen=True)
class Level:
    """A payload and friction, neither known to the controller.

    Attributes:
        payload_kg: Mass fixed to the tip adapter [kg].
        coulomb_nm: Dry friction of every joint; on real drives of every motor, before its torque loop [N m].
        drive: The arm's drives.
    """

    payload_kg: float = 0.0
    coulomb_nm: float = 0.0
    drive: Drive = "ideal"

    def __str__(self) -> str:
        """In words."""
        if self == NOMINAL:
            return "nominal"
        where = "friction" if self.drive == "ideal" else "motor friction"
        return f"payload {self.payload_kg:g} kg, {where} {self.coulomb_nm:g} N m"

    @property
    def assignments(self) -> tuple[str, ...]:
        """The scenario's disturbances and drives."""
        found = [f"{{type: payload, mass_kg: {self.payload_kg}}}"] if self.payload_kg else []
        if self.drive == "real":
            return f"disturbances=[{', '.join(found)}]", f"robot.drive={{coulomb_nm: {self.coulomb_nm}}}"
        found += [f"{{type: joint_friction, coulomb_nm: {self.coulomb_nm}}}"] if self.coulomb_nm else []
        return (f"disturbances=[{', '.join(found)}]",)


NOMINAL = Level()


class Column(NamedTuple):
    """A column of a ladder's table: its name, what it is to stay within, and its words."""

    name: str
    bound: float
    words: str


@dataclass(frozen=True)
class Ladder:
    """Every combination of payload and friction on some drives, for one controller beside another.

    Attributes:
        table: Its table's name.
        drive: The arm's drives.
        payloads_kg: Payloads, from none on [kg].
        frictions_nm: Frictions, from none on [N m].
        rival: Label of the controller whose errors are mapped.
        ours: Label of the one beside it.
    """

    table: str
    drive: Drive
    payloads_kg: Sequence[float]
    frictions_nm: Sequence[float]
    rival: str
    ours: str

    @property
    def levels(self) -> list[Level]:
        """The cells."""
        return [Level(m, f, self.drive) for m, f in product(self.payloads_kg, self.frictions_nm)]

    def rows(self, columns: Sequence[str], results: Results) -> list[Row]:
        """The table: these columns of every run."""
        return results.rows(self.table, *columns)

    def draw(
        self,
        columns: Sequence[Column],
        colours: Mapping[str, tuple[str, str]],
        axes: Axes,
        _: Results,
        tables: Tables,
    ) -> None:
        """A map of each column of the rival's; below, both controllers with payload or friction alone.

        Args:
            columns: Tip's and RCM's, a panel each.
            colours: Short name and colour of each label.
            axes: 2 x 2 panels.
            tables: With the ladder's.
        """
        where = "of each joint" if self.drive == "ideal" else "of each motor, before its torque loop"
        payload, friction = "payload at the adapter (kg)", f"Coulomb friction {where} (N m)"
        rows, short = tables[self.table], colours[self.rival][0]
        beside = {name: colours[name] for name in (self.rival, self.ours)}
        for ax, (column, bound, words) in zip(axes[0], columns, strict=True):
            mapped = pick(rows, controller=self.rival)
            found = {(row["payload_kg"], row["friction_nm"]): number(row, column) for row in mapped}
            values = np.array([[found[m, f] for f in self.frictions_nm] for m in self.payloads_kg])
            heat_map(ax, values, self.frictions_nm, self.payloads_kg, bound)
            ax.set(title=f"{short}, {words}; boxed: within {bound:g} mm", xlabel=friction)
        alone = (("payload_kg", {"friction_nm": 0.0}), ("friction_nm", {"payload_kg": 0.0}))
        for ax, (axis, without) in zip(axes[1], alone, strict=True):
            _draw_alone(ax, pick(rows, **without), axis, columns, beside)
        label(axes, [payload, friction], [payload, "largest error (mm)"])
        label(axes[1:], titles=["payload alone", "friction alone"])
        axes[1, 0].legend(frameon=False, fontsize=10, loc="upper left", ncols=2)

    def judge_within(self, column: str, bound: float, tables: Tables) -> tuple[bool, str]:
        """Whether the rival stays within a bound in every cell, and where it does not."""
        cells = pick(tables[self.table], controller=self.rival)
        over = [row for row in cells if number(row, column) > bound]
        alone = {"payload": pick(over, friction_nm=0.0), "friction": pick(over, payload_kg=0.0)}
        names = " and ".join(axis for axis, rows in alone.items() if rows) or "neither"
        where = "" if self.drive == "ideal" else " on real drives"
        return not over, (
            f"over the bound in {len(over)} of {len(cells)} cells of the ladder{where}, with one of the two "
            f"alone: {names}"
        )

    def judge_share(self, columns: Sequence[str], share: float, tables: Tables) -> Judged:
        """Whether ours has at most a share of the rival's figures in every cell."""
        rows, shares = pick(tables[self.table], controller=self.ours), []
        for row in rows:
            cell = {name: row[name] for name in ("payload_kg", "friction_nm")}
            (rival,) = pick(tables[self.table], controller=self.rival, **cell)
            shares += [number(row, column) / number(rival, column) for column in columns]
        tip, rcm = (max(numbers(rows, column)) for column in columns)
        cells = count(len(rows), "cell")
        return holds(max(shares) <= share), (
            f"{span([100.0 * x for x in shares], 2)} % of {self.rival}'s in {cells} of the ladder; at most "
            f"{tip:.3g} mm (tip) and {rcm:.3g} mm (RCM)"
        )


def _draw_alone(
    ax: Axes, rows: list[Row], axis: str, columns: Sequence[Column], colours: Mapping[str, tuple[str, str]]
) -> None:
    for name, (short, colour) in colours.items():
        mine = pick(rows, controller=name)
        for (column, _, _), style, what in zip(columns, ("o-", "s--"), ("tip", "RCM"), strict=True):
            ax.semilogy(
                numbers(mine, axis), numbers(mine, column), style, color=colour, label=f"{short}, {what}"
            )
    ax.set_ylim(1e-5, 3e3)
