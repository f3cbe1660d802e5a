"""Peg and ring: rings to be taken from their pegs and put on others."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

import mujoco
import numpy as np
from pydantic import Field, FiniteFloat, NonNegativeFloat, PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import ADDED
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
    describe_welds,
    grip,
    hold_force,
    open_jaws,
    sensed,
)
from surgsim.plant.props.hinged_jaws import (
    JawsLaw,
    Pinch,
    add_jaws,
    describe_jaws,
    drive_jaws,
    let_go,
    open_hinged,
    pinch,
    squeeze,
)
from surgsim.plant.props.peg_scene import add_board, add_holds, add_rings
from surgsim.plant.props.ring_state import ELSEWHERE, GRASPED, ON_TARGET, REST_S, add_rest, place_of
from surgsim.tick.algebra import norm, times
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
        hold: What holds a ring: a `weld` that gives way at `grip_force_n`, or the `friction` of two hinged
            jaws that press so hard that it slips at that force; with friction the shaft touches, too.
        jaws_turn_deg: Turn of the hinged jaws about the shaft; at 0 they close along the instrument's y
            [deg].
    """

    type: Literal["peg_board"] = "peg_board"
    capture_distance_m: PositiveFloat = 0.003
    close_at: Jaw = 0.5
    open_at: Jaw = 0.3
    grip_force_n: NonNegativeFloat = 3.0
    hold: Annotated[Literal["weld", "friction"], ADDED] = "weld"
    jaws_turn_deg: Annotated[FiniteFloat, ADDED] = 0.0

    @model_validator(mode="after")
    def _opens_after_closing(self) -> Self:
        if self.open_at > self.close_at:
            raise ValueError(f"open_at {self.open_at:g} must not be above close_at {self.close_at:g}")
        if self.hold == "weld" and self.jaws_turn_deg:
            raise ValueError("jaws_turn_deg turns hinged jaws: it needs hold 'friction'")
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
        hinged: Whether they are on hinges, and hold by friction.
        jaws: Of those on hinges.
    """

    SHAPES: ClassVar[dict[str, str]] = {"origin": "3", "R_BW": "3 3"}
    beside: float
    below: float
    origin: Array
    R_BW: Array
    grasp: GraspLaw
    hinged: int
    jaws: JawsLaw


class Handled(Record):
    """What is remembered; after it the rows of the rings (k, 3): state, time at rest [s], whether let go.

    Attributes:
        drops: Rings dropped.
        grasp: The jaws' hold.
        pinch: That of jaws on hinges.
    """

    drops: int
    grasp: Grasp
    pinch: Pinch


BOARD, BOARD_SIZE = overlay(Board)
HANDLED, HANDLED_SIZE = overlay(Handled)
_STATE, _REST, _LET_GO, _ROW = range(4)


@compiled
def _held(board: Board, seen: Handled) -> int:
    """The ring in the jaws, or NOBODY."""
    held: int = seen.pinch.held if board.hinged else seen.grasp.held
    return held


@compiled
def _hold(board: Board, rings: Array, seen: Handled, world: World) -> int:
    """Catch, hold or let go; the ring that slipped, or NOBODY."""
    if board.hinged:
        drive_jaws(board.jaws, world)
        return pinch(board.jaws, board.grasp.rings, seen.pinch, world)
    return grip(board.grasp, rings, seen.grasp, world)


@compiled
def handle_rings(gains: Array, world: World, memory: Array, out: Array) -> int:
    """Catch, hold or let go, and look where the rings are; once a step.

    A ring that was let go and rests on no peg was dropped, as was one that slipped.
    """
    board, seen = gains[:BOARD_SIZE].view(BOARD)[0], memory[:HANDLED_SIZE].view(HANDLED)[0]
    count = board.grasp.rings
    end = BOARD_SIZE + RING * count
    rings, pegs = gains[BOARD_SIZE:end].reshape(-1, RING), gains[end:].reshape(-1, 2)
    rows = memory[HANDLED_SIZE:].reshape(-1, _ROW)
    before = _held(board, seen)
    slipped = _hold(board, rings, seen, world)
    in_jaws = _held(board, seen)
    if slipped != NOBODY:
        seen.drops += 1
    elif before != NOBODY and in_jaws == NOBODY:
        rows[before, _LET_GO] = 1.0
    if in_jaws != NOBODY:
        rows[in_jaws, _LET_GO] = 0.0
    away, p = np.empty(3), np.empty(3)
    for i in range(count):
        row, place = rows[i], body_place(world, int(rings[i, BODY]))
        twist = vector(world.qvel + 8 * int(rings[i, DOF]), 6)
        row[_REST] = add_rest(row[_REST], twist, i == in_jaws, world.timestep_s)
        for k in range(3):
            away[k] = place[k] - board.origin[k]
        times(board.R_BW, away, p)
        held = i == in_jaws
        row[_STATE] = GRASPED if held else place_of(p, row[_REST], pegs, board.beside, board.below)
        if row[_LET_GO] == 1.0 and row[_REST] > REST_S:
            row[_LET_GO] = 0.0
            if row[_STATE] == ELSEWHERE:
                seen.drops += 1
    return GOES_ON


@compiled
def count_rings(gains: Array, world: World, memory: Array, out: Array) -> int:
    """States, rings on targets, drops, force on the jaws, force of the hold, of hinged jaws on the shaft."""
    board, seen = gains[:BOARD_SIZE].view(BOARD)[0], memory[:HANDLED_SIZE].view(HANDLED)[0]
    count, rows = board.grasp.rings, memory[HANDLED_SIZE:].reshape(-1, _ROW)
    rings = gains[BOARD_SIZE : BOARD_SIZE + RING * count].reshape(-1, RING)
    on_target = 0
    for i in range(count):
        out[i] = rows[i, _STATE]
        on_target += rows[i, _STATE] == ON_TARGET
    out[count], out[count + 1] = on_target, seen.drops
    if board.hinged:
        held = seen.pinch.held
        out[count + 2] = norm(world.f_T)
        out[count + 3] = squeeze(board.jaws, held, world) if held != NOBODY else 0.0
        out[count + 4] = sensed(world, board.jaws.shaft)
        return GOES_ON
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
            *((scalar("shaft_load", "n"),) if config.hold == "friction" else ()),
        )
        pegs = np.array([*config.source_m, *config.target_m])
        self.gains = np.concatenate([np.zeros(BOARD_SIZE + RING * count), pegs.ravel()])
        self.memory = np.zeros(HANDLED_SIZE + _ROW * count)

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Add board, rings and what holds them: welds, or jaws on hinges."""
        add_board(spec, self._c)
        add_rings(spec, self._c)
        if self._c.hold == "friction":
            add_jaws(spec, self._c, math.radians(self._c.jaws_turn_deg))
        else:
            add_holds(spec, self._c)

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """All rings on their sources, jaws open."""
        c, board, seen = self._c, laid_over(Board, self.gains), laid_over(Handled, self.memory)
        board.beside, board.below = c.hole_radius_m, 0.5 * c.peg_height_m
        board.origin[:], board.R_BW[:] = c.position_m, c.R_WB.T
        take(board.grasp, c)
        take(board.jaws, c)
        board.hinged = c.hold == "friction"
        if board.hinged:
            describe_jaws(board.jaws, scene, c.grip_force_n)
            open_hinged(scene, data)
        rings = describe_grasp(board.grasp, scene, data, c)
        if not board.hinged:
            describe_welds(board.grasp, scene, rings)
        self.gains[BOARD_SIZE : BOARD_SIZE + rings.size] = rings.ravel()
        self.memory[:] = 0.0
        let_go(seen.pinch)
        if not board.hinged:
            open_jaws(board.grasp, rings, seen.grasp)
