"""Named columns: what a part of the simulation adds to the record of a run."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Block:
    """Columns that belong together, e.g. the joint positions.

    Attributes:
        name: Stem of the columns' names.
        labels: What tells them apart: joints `1`, `2` and so on, axes `x`, `y`, `z`, or one empty label.
        unit: SI unit suffix, empty for a pure number.
        joiner: What stands between name and label.
    """

    name: str
    labels: tuple[str, ...]
    unit: str
    joiner: str = "_"

    @property
    def columns(self) -> tuple[str, ...]:
        """Column names, e.g. `q1_rad`, `tip_x_m`, `manipulability`."""
        stems = [f"{self.name}{self.joiner}{label}" if label else self.name for label in self.labels]
        return tuple(f"{stem}_{self.unit}" if self.unit else stem for stem in stems)


def of_arm(arm: str, block: Block) -> Block:
    """The block of one of several arms: its name begins with the arm's and `_`."""
    return replace(block, name=f"{arm}_{block.name}")


def joints(name: str, unit: str, n: int) -> Block:
    """Block of a column for each of `n` joints."""
    return Block(name, tuple(str(i + 1) for i in range(n)), unit, joiner="")


def vector(name: str, unit: str) -> Block:
    """Block of x, y and z."""
    return Block(name, AXES, unit)


def scalar(name: str, unit: str = "") -> Block:
    """Block of one column."""
    return Block(name, ("",), unit)


def width(blocks: Iterable[Block]) -> int:
    """Number of columns of some blocks."""
    return sum(len(block.columns) for block in blocks)
