"""A board with pegs and rings: where everything is, and where the instrument's tip has to go.

Frame B is the board's: origin at the middle of its upper face, z out of it. A ring is a torus that lies on
the board round its peg. It is grasped at its rim, from above.

Sizes of hole and peg are those of the peg transfer of the Fundamentals of Laparoscopic Surgery (FLS) as
printed by Hwang et al., Applying Depth-Sensing to Automated Surgical Manipulation with a da Vinci Robot
(2020): openings of 4.5 mm radius on pegs of 2.25 mm. FLS blocks are triangular; a ring of the same hole need
not be turned about the peg. Height of the pegs and size of rim and ring are ours.
"""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, FiniteFloat, PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.models.config import Vec3
from surgsim.spatial import plane_axes, unit

Vec2 = tuple[FiniteFloat, FiniteFloat]
Pegs = Annotated[tuple[Vec2, ...], Field(min_length=1, max_length=12)]


class PegBoardLayout(PartConfig):
    """Where board, pegs and rings are, and their sizes.

    The n-th ring lies on the n-th source peg and belongs on the n-th target peg.

    Attributes:
        position_m: Middle of the board's upper face, world frame [m].
        normal: Direction out of that face.
        direction: The board's x axis, made normal to `normal`.
        source_m: Places of the source pegs on the board, x and y each [m].
        target_m: Places of the target pegs, as many [m].
        peg_radius_m: Radius of a peg [m].
        peg_height_m: Height of a peg, its round top included [m].
        hole_radius_m: Radius of a ring's hole [m].
        rim_radius_m: Radius of the round rim's cross-section [m].
        ring_mass_kg: Mass of a ring [kg].
    """

    position_m: Vec3 = (0.0, 0.65, -0.06)
    normal: Vec3 = (0.0, 0.0, 1.0)
    direction: Vec3 = (1.0, 0.0, 0.0)
    source_m: Pegs = ((-0.02, -0.022), (0.0, -0.022), (0.02, -0.022))
    target_m: Pegs = ((-0.02, 0.022), (0.0, 0.022), (0.02, 0.022))
    peg_radius_m: PositiveFloat = 0.00225
    peg_height_m: PositiveFloat = 0.010
    hole_radius_m: PositiveFloat = 0.0045
    rim_radius_m: PositiveFloat = 0.00125
    ring_mass_kg: PositiveFloat = 0.003

    @model_validator(mode="after")
    def _possible(self) -> Self:
        plane_axes(np.array(self.normal), np.array(self.direction))
        if len(self.source_m) != len(self.target_m):
            raise ValueError(
                f"{len(self.source_m)} source pegs and {len(self.target_m)} target pegs: as many"
            )
        if self.hole_radius_m <= self.peg_radius_m:
            raise ValueError(
                f"hole_radius_m {self.hole_radius_m:g} must be above peg_radius_m {self.peg_radius_m:g}"
            )
        if self.peg_height_m <= max(2 * self.rim_radius_m, self.peg_radius_m):
            raise ValueError(
                f"peg_height_m {self.peg_height_m:g} must stand out of the ring that lies round it"
            )
        pegs = np.array([*self.source_m, *self.target_m])
        gaps = np.linalg.norm(pegs[:, None] - pegs[None, :], axis=2)
        gaps[np.diag_indices(len(pegs))] = np.inf
        widest = 2 * (self.hole_radius_m + 2 * self.rim_radius_m)
        if gaps.min() <= widest:
            raise ValueError(f"pegs {gaps.min():g} m apart; rings {widest:g} m wide would overlap")
        return self

    @property
    def ring_radius_m(self) -> float:
        """Radius of the circle in the middle of the rim [m]."""
        return self.hole_radius_m + self.rim_radius_m

    @property
    def R_WB(self) -> Array:
        """Orientation of the board (3, 3)."""
        return np.column_stack(plane_axes(np.array(self.normal), np.array(self.direction)))

    def point(self, x: float, y: float, height: float) -> Array:
        """Point `height` above place (x, y) of the board, world frame (3,) [m]."""
        point: Array = np.array(self.position_m) + self.R_WB @ np.array([x, y, height])
        return point


TRANSFER_STEPS = (
    "hover_source",
    "approach",
    "grasp",
    "lift",
    "hover_target",
    "place",
    "release",
    "leave",
)
"""Steps of a ring's transfer, in order."""
_JAWS_ABOVE_RIM_M = 0.0005
_RING_ABOVE_PEG_M = 0.004
_PLACE_ABOVE_BOARD_M = 0.002


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TransferGoal:
    """A place to bring the tip to, and what the jaws do there.

    Attributes:
        name: What it is for, e.g. `ring1 grasp`.
        position: Tip, world frame (3,) [m].
        jaw: How far the jaws close from arriving here on, from 0 (open) to 1.
        tolerance_m: How near the tip must be before the jaws act and the next goal is sought [m].
        dwell_s: How long to stay [s].
        ring: The ring that it is about, from 0.
    """

    name: str
    position: Array
    jaw: float
    tolerance_m: float
    dwell_s: float
    ring: int


def grasp_side(layout: PegBoardLayout, ring: int) -> Array:
    """Direction on the board from a ring's centre to where its rim is grasped, a unit vector (2,).

    Across the way from source to target, so that the shaft's change of inclination on the way tilts the ring
    about the grasped point and its centre together. Of the two sides the one nearer to the board's middle:
    there the shaft leans away from the peg, if the port is above the middle.
    """
    source, target = np.array(layout.source_m[ring]), np.array(layout.target_m[ring])
    way = unit(target - source)
    across = np.array([way[1], -way[0]])
    return across if across @ (source + target) <= 1e-12 else -across


def transfer_goals(layout: PegBoardLayout) -> list[TransferGoal]:
    """What the tip has to do to bring every ring to its target peg, ring after ring."""
    return [goal for ring in range(len(layout.source_m)) for goal in _transfer(layout, ring)]


def _transfer(layout: PegBoardLayout, ring: int) -> list[TransferGoal]:
    reach = layout.ring_radius_m * grasp_side(layout, ring)
    low = 2 * layout.rim_radius_m + _JAWS_ABOVE_RIM_M
    high = low + layout.peg_height_m + _RING_ABOVE_PEG_M
    source, target = np.array(layout.source_m[ring]) + reach, np.array(layout.target_m[ring]) + reach
    steps = (
        (source, high, 0.0, 0.002, 0.0),
        (source, low, 0.0, 0.001, 0.1),
        (source, low, 1.0, 0.001, 0.2),
        (source, high, 1.0, 0.002, 0.0),
        (target, high, 1.0, 0.001, 0.1),
        (target, low + _PLACE_ABOVE_BOARD_M, 1.0, 0.001, 0.2),
        (target, low + _PLACE_ABOVE_BOARD_M, 0.0, 0.001, 0.3),
        (target, high, 0.0, 0.002, 0.0),
    )
    return [
        TransferGoal(
            name=f"ring{ring + 1} {name}",
            position=layout.point(float(place[0]), float(place[1]), height),
            jaw=jaw,
            tolerance_m=tolerance,
            dwell_s=dwell,
            ring=ring,
        )
        for name, (place, height, jaw, tolerance, dwell) in zip(TRANSFER_STEPS, steps, strict=True)
    ]
