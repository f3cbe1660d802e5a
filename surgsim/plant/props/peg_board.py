"""Peg and ring: rings to be taken from their pegs and put on others."""

from typing import Annotated, Literal, Self

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from surgsim.columns import Block, scalar
from surgsim.models.build import Scene
from surgsim.models.peg_board import PegBoardLayout
from surgsim.plant.props.base import Prop
from surgsim.plant.props.grasp import Grasp, GraspLaw
from surgsim.plant.props.peg_scene import add_board, add_holds, add_rings, ring_name
from surgsim.plant.props.ring_state import REST_S, RingState, find_states, time_at_rest

Array = NDArray[np.float64]
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


class PegBoard(Prop):
    """Board, pegs, rings and the jaws' hold on them.

    A ring is on a peg if the peg stands in its hole and its middle is lower than half the peg's height; on a
    target it must also be at rest and out of the jaws. A drop is a ring that slipped out of the jaws, or was
    let go and came to rest on no peg.
    """

    def __init__(self, config: PegBoardConfig) -> None:
        self._c = config
        self._count = len(config.source_m)
        rings = tuple(str(i + 1) for i in range(self._count))
        self.columns = (
            Block("ring_state", rings, ""),
            scalar("rings_on_target"),
            scalar("ring_drop_count"),
            scalar("jaws_load", "n"),
            scalar("grip_force", "n"),
        )
        self._board = (
            np.array(config.position_m),
            config.R_WB.T.copy(),
            np.array([*config.source_m, *config.target_m]),
            np.array([config.hole_radius_m, 0.5 * config.peg_height_m]),
        )
        self._grasp: Grasp | None = None
        self._forget()

    def modify(self, spec: mujoco.MjSpec) -> None:
        """Add board, rings and the welds that hold them."""
        add_board(spec, self._c)
        add_rings(spec, self._c)
        add_holds(spec, self._c)

    def start(self, scene: Scene, data: mujoco.MjData, rng: np.random.Generator, dt_s: float) -> None:
        """All rings on their sources, jaws open."""
        c = self._c
        law = GraspLaw(
            close_at=c.close_at,
            open_at=c.open_at,
            capture_distance_m=c.capture_distance_m,
            grip_force_n=c.grip_force_n,
        )
        self._data, self._timestep = data, float(scene.model.opt.timestep)
        self._bodies = np.array([scene.model.body(ring_name(ring)).id for ring in range(self._count)])
        dofs = [int(scene.model.joint(ring_name(ring)).dofadr[0]) for ring in range(self._count)]
        self._dofs = np.array(dofs)[:, None] + np.arange(6)
        self._grasp = Grasp(scene, data, c, law)
        self._forget()

    def grip(self, jaw: float) -> None:
        """Remember how far the jaws are told to close."""
        self._jaw = jaw

    def push(self, t_s: float, scene: Scene, data: mujoco.MjData) -> None:
        """Catch, hold or let go, and look where the rings are; once a step."""
        grasp = self._grasp
        assert grasp is not None
        before = grasp.held
        slipped = grasp.act(self._jaw)
        if slipped is not None:
            self._drops += 1
        elif before is not None and grasp.held is None:
            self._let_go[before] = True
        if grasp.held is not None:
            self._let_go[grasp.held] = False
        self._look(grasp.held)

    def values(self) -> Array:
        """States, rings on targets, drops, force on the jaws, force of the hold."""
        load = hold = 0.0
        if self._grasp is not None:
            load, hold = self._grasp.load(), self._grasp.hold_force()
        on_target = np.count_nonzero(self._states == RingState.ON_TARGET)
        return np.array([*self._states, on_target, self._drops, load, hold])

    def _forget(self) -> None:
        self._jaw = 0.0
        self._states = np.full(self._count, float(RingState.ON_SOURCE))
        self._let_go = np.zeros(self._count, dtype=bool)
        self._drops = 0
        self._rest_s = np.zeros(self._count)

    def _look(self, held: int | None) -> None:
        """Find each ring's state; a ring that was let go and rests on no peg was dropped."""
        data, ring = self._data, -1 if held is None else held
        time_at_rest(self._rest_s, data.qvel[self._dofs], ring, self._timestep)
        positions = data.xpos[self._bodies]
        find_states(self._states, self._rest_s, positions, ring, *self._board)
        for i in np.flatnonzero(self._let_go):
            if self._rest_s[i] > REST_S:
                self._let_go[i] = False
                self._drops += int(self._states[i] == RingState.ELSEWHERE)
