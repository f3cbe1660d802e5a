"""Random homes that nothing is fitted to: how often a method gains from them, and how much."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from surgsim.studies.samples import sample_row
from surgsim.studies.study import Case, Measured
from surgsim.studies.tables import Row, number, numbers, pick


@dataclass(frozen=True)
class RandomHome(Case):
    """A home with its joints uniform in their ranges, and every path from it.

    Many homes are too near to the edge of the workspace or to a joint's limit for a path. One counts only if
    the base method, which gains nothing, follows every path from it.

    Attributes:
        index: Of the home; with `seed` it gives the joints.
        seed: Of all homes.
        followed_m: How near to the path the base method's tip stays [m].
        ranges_rad: Largest positions of the joints, ranges being symmetric [rad].
        paths: Their names.
    """

    index: int

    seed: ClassVar[int]
    followed_m: ClassVar[float] = 1e-3
    ranges_rad: ClassVar[tuple[float, ...]]
    paths: ClassVar[tuple[str, ...]]

    def draw(self) -> tuple[float, ...]:
        """Joint positions (n,) [rad]."""
        rng = np.random.default_rng([self.seed, self.index])
        return tuple(map(float, rng.uniform(-1.0, 1.0, len(self.ranges_rad)) * np.array(self.ranges_rad)))

    @abstractmethod
    def both(self) -> tuple[str, str]:
        """The base method, and the one that should gain."""

    @abstractmethod
    def follow(self, path: str, method: str) -> Mapping[str, Any]:
        """Of a run: `outcome`, `mu_mean`, `matched_max_m`, `position_margin_rad`."""

    def measured(self) -> Measured:
        """Averages of mu and the increase along each path, if the base method follows all of them."""
        base, gaining = self.both()
        found = {path: self.follow(path, base) for path in self.paths}
        follows = all(map(self._follows, found.values()))
        row: dict[str, Any] = {"home": self.index}
        row |= {f"q{i + 1}_rad": x for i, x in enumerate(self.draw())}
        row["followed"] = "yes" if follows else "no"
        for path, run in found.items():
            columns = (f"{path}_{base}", f"{path}_{gaining}", f"{path}_percent")
            mu = [run["mu_mean"], self.follow(path, gaining)["mu_mean"]] if follows else []
            values = [*mu, 100.0 * (mu[1] / mu[0] - 1.0)] if follows else 3 * [None]
            row |= dict(zip(columns, values, strict=True))
        return Measured(case=self, row=row)

    def _follows(self, run: Mapping[str, Any]) -> bool:
        near = run["matched_max_m"] <= self.followed_m and run["position_margin_rad"] > 0.0
        return bool(near and run["outcome"] == "completed")


def homes_table(every: Sequence[Row], paths: Sequence[str], wanted: int) -> list[Row]:
    """The increase from the first `wanted` homes that count: along each path, and the least of all paths."""
    rows = pick(every, followed="yes")[:wanted]
    by_path = {path: numbers(rows, f"{path}_percent") for path in paths}
    by_path["least of all"] = [min(found) for found in zip(*by_path.values(), strict=True)]
    drawn = 1 + max((int(number(row, "home")) for row in rows), default=0)
    return [{"path": path, "drawn": drawn, **sample_row(v)} for path, v in by_path.items() if v]
