"""Peg and ring: rings to be taken from their pegs and put on others."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

import mujoco
import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.columns import Block, scalar
from surgsim.compiled import compiled
from surgsim.models.build import Scene
from surgsim.models.peg_board import PegBoardLayout
from surgsim.plant.props.base import Prop
from surgsim.plant.props.grasp import (
    BODY,
    DOF,
    NOBODY,
    RING,
    Grasp,
    GraspLaw,
    describe_grasp,
    grip,
    hold_force,
    open_jaws,
    sensed,
)
from surgsim.plant.props.peg_scene import add_board, add_holds, add_rings
from surgsim.plant.props.ring_state import ELSEWHERE, GRASPED, ON_TARGET, REST_S, add_rest, place_of
from surgsim.tick.algebra import times
from surgsim.tick.arrays import Record, World
from surgsim.tick.overlay import laid_over, overlay, take
from surgsim.tick.status import GOES_ON
from surgsim.tick.views import body_place, vector

Jaw = Annotated[float, Field(gt=0.0, lt=1.0)]


class PegBoardConfig(PegBoardLayout):
    """A board with pegs, and rings that the jaws can carry from peg to peg.

    Attributes:
        capture_distance_m: How near to a rim's surface the tip must be for the jaws to catch it [m].
        close_at: How far closed the jaws catch, from 0 (open) to 1.
        open_at: How far closed they let go again.
        grip_force_n: Force at which a ring slips out of fully closed jaws, in proportion if less closed [N].
    """

    type: Literal["peg_board"] = "peg_board"
    capture_distance_m: PositiveFloat = 0.003
    close_at: Jaw = 0.5
    open_at: Jaw = 0.3
    grip_force_n: NonNegativeFloat = 3.0

    @model_validator(mode="after")
    def _opens_after_closing(self) -> Self:
        if self.open_at > self.close_at:
            raise ValueError(f"open_at {self.open_at:g} must not be above close_at {self.close_at:g}")
        return self

    def build(self, rng: np.random.Generator) -> "PegBoard":
        """The prop."""
        return PegBoard(self)


class Board(Record):
    """Numbers of board and grasp; after it in the gains the rings' rows (k, 6) and the pegs (2k, 2) [m].

    Attributes:
        beside: How far beside a peg a ring's middle may be [m].
        below: How far above the board [m].
        origin: Of the board (3,) [m].
        R_BW: World in the board's frame (3, 3).
        grasp: Of the jaws.
    """

    SHAPES: ClassVar[dict[str, str]] = {"origin": "3", "R_BW": "3 3"}
    beside: float
    below: float
    origin: Array
    R_BW: Array
    grasp: GraspLaw


class Handled(Record):
    """What is remembered; after it the rows of the rings (k, 3): state, time at rest [s], whether let go.

    Attributes:
        drops: Rings dropped.
        grasp: The jaws' hold.
    """

    drops: int
    grasp: Grasp


BOARD, BOARD_SIZE = overlay(Board)
HANDLED, HANDLED_SIZE = overlay(Handled)
_STATE, _REST, _LET_GO, _ROW = range(4)


@compiled
def handle_rings(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Catch, hold or let go, and look where the rings are; once a step.

    A ring that was let go and rests on no peg was dropped, as was one that slipped.
    """
    board, seen = gains[:BOARD_SIZE].view(BOARD)[0], memory[:HANDLED_SIZE].view(HANDLED)[0]
    count, grasp = board.grasp.rings, seen.grasp
    end = BOARD_SIZE + RING * count
    rings, pegs = gains[BOARD_SIZE:end].reshape(-1, RING), gains[end:].reshape(-1, 2)
    rows = memory[HANDLED_SIZE:].reshape(-1, _ROW)
    before = grasp.held
    if grip(board.grasp, rings, grasp, world) != NOBODY:
        seen.drops += 1
    elif before != NOBODY and grasp.held == NOBODY:
        rows[before, _LET_GO] = 1.0
    if grasp.held != NOBODY:
        rows[grasp.held, _LET_GO] = 0.0
    away, p = np.empty(3), np.empty(3)
    for i in range(count):
        row, place = rows[i], body_place(world, int(rings[i, BODY]))
        twist = vector(world.qvel + 8 * int(rings[i, DOF]), 6)
        row[_REST] = add_rest(row[_REST], twist, i == grasp.held, world.timestep_s)
        for k in range(3):
            away[k] = place[k] - board.origin[k]
        times(board.R_BW, away, p)
        held = i == grasp.held
        row[_STATE] = GRASPED if held else place_of(p, row[_REST], pegs, board.beside, board.below)
        if row[_LET_GO] == 1.0 and row[_REST] > REST_S:
            row[_LET_GO] = 0.0
            if row[_STATE] == ELSEWHERE:
                seen.drops += 1
    return GOES_ON


@compiled
def count_rings(gains: Array, world: World, memory: Array, out: Array) -> int:
    """States, rings on targets, drops, force on the jaws, force of the hold."""
    board, seen = gains[:BOARD_SIZE].view(BOARD)[0], memory[:HANDLED_SIZE].view(HANDLED)[0]
    count, rows = board.grasp.rings, memory[HANDLED_SIZE:].reshape(-1, _ROW)
    rings = gains[BOARD_SIZE : BOARD_SIZE + RING * count].reshape(-1, RING)
    on_target = 0
    for i in range(count):
        out[i] = rows[i, _STATE]
        on_target += rows[i, _STATE] == ON_TARGET
    out[count], out[count + 1] = on_target, seen.drops
    out[count + 2], out[count + 3] = sensed(world, board.grasp.load), hold_force(rings, seen.grasp, world)
    return GOES_ON


class PegBoard(Prop):
    """Board, pegs, rings and the jaws' hold on them: `handle_rings`.

    A ring is on a peg if the peg stands in its hole and its middle is lower than half the peg's height; on a
    target it must also be at rest and out of the jaws. A drop is a ring that slipped out of the jaws, or was
    let go and came to rest on no peg.
    """

    kernels: Mapping[str, Any] = {"push": handle_rings, "values": count_rings}

    def __init__(self, config: PegBoardConfig) -> None:
        self._c = config
        count = len(config.source_m)
        self.columns = (
            Block("ring_state", tuple(str(i + 1) for i in range(count)), ""),
            scalar("rings_on_target"),
            scalar("ring_drop_count"),
            scalar("jaws_load", "n"),
            scalar("grip_force", "n"),
        )
        pegs = np.array([*config.source_m, *config.target_m])
        self.gains = np.concatenate([np.zeros(BOARD_SIZE + RING * count), pegs.ravel()])
        self.memory = np.zeros(HANDLED_SIZE + _ROW * count)

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Add board, rings and the welds that hold them."""
        add_board(spec, self._c)
        add_rings(spec, self._c)
        add_holds(spec, self._c)

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """All rings on their sources, jaws open."""
        c, board, seen = self._c, laid_over(Board, self.gains), laid_over(Handled, self.memory)
        board.beside, board.below = c.hole_radius_m, 0.5 * c.peg_height_m
        board.origin[:], board.R_BW[:] = c.position_m, c.R_WB.T
        take(board.grasp, c)
        rings = describe_grasp(board.grasp, scene, data, c)
        self.gains[BOARD_SIZE : BOARD_SIZE + rings.size] = rings.ravel()
        self.memory[:] = 0.0
        open_jaws(board.grasp, rings, seen.grasp)
