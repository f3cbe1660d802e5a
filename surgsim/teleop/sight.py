"""What the simulated operator sees of the rings, and what it makes of it.

A picture has the tip and the middle of every ring. It is taken at the remote side at every tick, and the
operator sees the one of the newest packet that has come: as late as the tip, and the two together.

    aim at a ring     target = goal + (ring as seen - ring at first) + error
    aim at a peg      target = goal + (tip - ring as seen, along the board) - (tip - ring as planned) + error

So a ring that lies elsewhere is grasped where it lies, and one that is held askew is put down by its middle.
The error is drawn anew whenever the operator takes aim.
"""

import math
from typing import ClassVar

import numpy as np
from pydantic import NonNegativeFloat, NonNegativeInt

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.columns import scalar, vector
from surgsim.compiled import compiled
from surgsim.models.config import Vec3
from surgsim.models.peg_board import TRANSFER_STEPS, PegBoardLayout, grasp_side
from surgsim.spatial import plane_axes
from surgsim.tick.algebra import dot
from surgsim.tick.arrays import Feedback, Record
from surgsim.tick.views import numbers

SIGHT_COLUMNS = (scalar("regrasps"), scalar("rings_given_up"), vector("aim_error", "m"))


class SightConfig(PartConfig):
    """Whether the operator looks at the rings, and how well it sees where to aim.

    Without `use` it goes through the program of `peg_and_ring` as it was planned, whatever becomes of the
    rings. With it, it aims at a ring where it sees it, and looks after each step whether the ring came along:
    one that did not come up, was lost on the way or lies beside its peg is grasped again, for as long as the
    time lasts. A ring that fell off the board is given up.

    The errors are a choice. They make the operator miss about as often as the experienced surgical resident
    of Hwang et al., Superhuman Surgical Peg Transfer (2020), arXiv 2012.12844, who succeeded in 93.2 % of
    transfers with a handover. Depth is seen worse than what is across it: Sakata et al., Br. J. Surg. 104(8),
    2017.

    Attributes:
        use: Whether it looks at the rings.
        across_m: Standard deviation of its aim across the line of sight, along each of two axes [m].
        depth_m: The same along the line of sight [m].
        line_of_sight: Where the endoscope looks, world frame.
        corrections: How often it corrects a movement; after that it goes on with what it has reached, since
            the jaws may be on the board.
    """

    use: bool = False
    across_m: NonNegativeFloat = 0.0007
    depth_m: NonNegativeFloat = 0.001
    line_of_sight: Vec3 = (0.0, 0.5, -1.0)
    corrections: NonNegativeInt = 3


class SightLaw(Record):
    """Numbers of seeing.

    Attributes:
        use: Whether rings are looked at.
        corrections: How often a movement is corrected.
        rings: How many there are.
        board: Where in the gains the rings' rows begin: middle at first, tip from the middle as grasped,
            middle on the target, and where in the plant's columns its place is (10,) each.
        pictures: Where in the memory the pictures begin, a row (3 + 3 k,) [m] each: tip, then the rings.
        kept: How many pictures are kept.
        seen: Where in the memory the picture is that is seen.
        aims: Where in the memory the draws of the aim begin, a row (3,) each.
        width_m: Outer diameter of a ring [m].
        beside_m: How far beside its peg the middle of a ring may be [m].
        low_m: How low it must be to lie on its peg, and how high to have come up [m].
        origin: Middle of the board's face (3,) [m].
        normal: Out of it (3,).
        spread: What a draw is multiplied with to be an error of the aim, world frame (3, 3) [m].
    """

    SHAPES: ClassVar[dict[str, str]] = {"origin": "3", "normal": "3", "spread": "3 3"}
    use: int
    corrections: int
    rings: int
    board: int
    pictures: int
    kept: int
    seen: int
    aims: int
    width_m: float
    beside_m: float
    low_m: float
    origin: Array
    normal: Array
    spread: Array


class Sight(Record):
    """What was seen.

    Attributes:
        number: The picture that is seen; -1 before the first.
        aimed: Rows of draws used.
        moves: Movements to the present goal.
        regrasps: How often it has gone back for a ring.
        given_up: Rings given up.
        shift: From a goal's place to where it aims (3,) [m].
        error: The error in it (3,) [m].
    """

    SHAPES: ClassVar[dict[str, str]] = {"shift": "3", "error": "3"}
    number: int
    aimed: int
    moves: int
    regrasps: int
    given_up: int
    shift: Array
    error: Array


HOME, GRASPED, TARGET, SHOWN, RING_ROW = 0, 3, 6, 9, 10
"""Where in a ring's row its numbers are, and its length."""
STEPS = len(TRANSFER_STEPS)
_FIRST, _LIFT, _OVER, _LAST = (
    TRANSFER_STEPS.index(name) for name in ("hover_source", "lift", "hover_target", "leave")
)
_NOT_SHOWN = -1.0


def describe_sight(law: SightLaw, config: SightConfig, layout: PegBoardLayout) -> None:
    """Fill the numbers of eyes and board; the places in gains and memory are the caller's."""
    law.use, law.corrections, law.rings = config.use, config.corrections, len(layout.source_m)
    law.width_m = 2.0 * (layout.ring_radius_m + layout.rim_radius_m)
    law.beside_m, law.low_m = layout.hole_radius_m, 0.5 * layout.peg_height_m
    law.origin[:], law.normal[:] = layout.position_m, layout.R_WB[:, 2]
    sight = np.array(config.line_of_sight)
    side = np.eye(3)[int(np.argmin(np.abs(sight)))]
    law.spread[:] = np.column_stack(plane_axes(sight, side)) * [
        config.across_m,
        config.across_m,
        config.depth_m,
    ]


def board_rows(layout: PegBoardLayout) -> Array:
    """The rings' rows (k, 10); where they are shown is not known yet."""
    rows = np.full((len(layout.source_m), RING_ROW), _NOT_SHOWN)
    for ring, row in enumerate(rows):
        reach = layout.ring_radius_m * grasp_side(layout, ring)
        row[HOME:GRASPED] = layout.point(*layout.source_m[ring], layout.rim_radius_m)
        row[GRASPED:TARGET] = layout.R_WB[:, :2] @ reach
        row[TARGET:SHOWN] = layout.point(*layout.target_m[ring], layout.rim_radius_m)
    return rows


@compiled
def picture_size(rings: int) -> int:
    """Numbers of a picture: tip, then the rings."""
    return 3 + 3 * rings


@compiled
def take_picture(law: SightLaw, gains: Array, feedback: Feedback, memory: Array, number: int) -> None:
    """Keep what the endoscope sees now as the picture `number`."""
    plant = feedback.plant
    at = law.pictures + picture_size(law.rings) * (number % law.kept)
    for i in range(3):
        memory[at + i] = feedback.p_WT[i]
    for ring in range(law.rings):
        row = law.board + RING_ROW * ring
        place = int(gains[row + SHOWN])
        known = place >= 0 and plant.length > 0
        shown = numbers(plant)[place : place + 3] if known else gains[row + HOME : row + GRASPED]
        for i in range(3):
            memory[at + 3 + 3 * ring + i] = shown[i]


@compiled
def see_picture(law: SightLaw, sight: Sight, memory: Array, number: int) -> None:
    """Look at the picture `number`, of the newest packet; before the first one, at how all is at first."""
    if number == sight.number:
        return
    sight.number = number
    size = picture_size(law.rings)
    at = law.pictures + size * (number % law.kept)
    for i in range(size):
        memory[law.seen + i] = memory[at + i]


def show_first(law: SightLaw, gains: Array, sight: Sight, memory: Array, tip: Array) -> None:
    """Begin: the rings are where the program has them."""
    sight.number = -1
    rows = gains[law.board : law.board + RING_ROW * law.rings].reshape(-1, RING_ROW)
    seen = np.concatenate([tip, rows[:, HOME:GRASPED].ravel()])
    memory[law.seen : law.seen + seen.size] = seen


@compiled
def _ring_seen(law: SightLaw, memory: Array, ring: int) -> Array:
    """The middle of a ring as it is seen (3,) [m]."""
    at = law.seen + 3 + 3 * ring
    return memory[at : at + 3]


@compiled
def _height(law: SightLaw, p: Array) -> float:
    """Of a point (3,) above the board [m]."""
    height = 0.0
    for i in range(3):
        height += law.normal[i] * (p[i] - law.origin[i])
    return height


@compiled
def has_come_up(law: SightLaw, memory: Array, ring: int) -> bool:
    """Whether a ring is seen in the jaws, off the board: nearer to the tip than its width."""
    p, square = _ring_seen(law, memory, ring), 0.0
    for i in range(3):
        away = p[i] - memory[law.seen + i]
        square += away * away
    return math.sqrt(square) < law.width_m and _height(law, p) > law.low_m


@compiled
def is_placed(law: SightLaw, gains: Array, memory: Array, ring: int) -> bool:
    """Whether a ring is seen round its target peg."""
    p, away = _ring_seen(law, memory, ring), np.empty(3)
    row = law.board + RING_ROW * ring
    height = _height(law, p)
    for i in range(3):
        away[i] = p[i] - gains[row + TARGET + i]
    along = dot(away, law.normal)
    beside = dot(away, away) - along * along
    return beside < law.beside_m * law.beside_m and 0.0 < height < law.low_m


@compiled
def take_aim(law: SightLaw, gains: Array, sight: Sight, memory: Array, index: int) -> None:
    """Before going to a ring, and before going to its peg: where to, as far as it can be seen."""
    ring, step = index // STEPS, index % STEPS
    sight.moves = 0
    if step not in (_FIRST, _OVER):
        return
    draw = law.aims + 3 * sight.aimed
    sight.aimed += 1
    p, row = _ring_seen(law, memory, ring), law.board + RING_ROW * ring
    for i in range(3):
        sight.error[i] = 0.0
        for k in range(3):
            sight.error[i] += law.spread[i, k] * memory[draw + k]
    if step == _FIRST:
        for i in range(3):
            sight.shift[i] = p[i] - gains[row + HOME + i]
    else:
        above = 0.0
        for i in range(3):
            sight.shift[i] = memory[law.seen + i] - p[i] - gains[row + GRASPED + i]
            above += law.normal[i] * sight.shift[i]
        for i in range(3):
            sight.shift[i] -= above * law.normal[i]
    for i in range(3):
        sight.shift[i] += sight.error[i]


@compiled
def goal_after(law: SightLaw, gains: Array, sight: Sight, memory: Array, index: int) -> int:
    """The goal after one that was reached: the next, or the first again where the ring did not come along."""
    ring, step = index // STEPS, index % STEPS
    lost = step in (_LIFT, _OVER) and not has_come_up(law, memory, ring)
    if lost or (step == _LAST and not is_placed(law, gains, memory, ring)):
        return once_more(law, sight, memory, ring)
    return index + 1


@compiled
def once_more(law: SightLaw, sight: Sight, memory: Array, ring: int) -> int:
    """The goal with which a ring is sought again; that of the next ring where it fell off the board."""
    if _height(law, _ring_seen(law, memory, ring)) < 0.0:
        sight.given_up += 1
        return STEPS * (ring + 1)
    sight.regrasps += 1
    return STEPS * ring


@compiled
def fill_sight_columns(sight: Sight, out: Array) -> None:
    """Values of `SIGHT_COLUMNS`."""
    out[0], out[1] = sight.regrasps, sight.given_up
    for i in range(3):
        out[2 + i] = sight.error[i]
