"""Teleoperation: the tip follows a master console through a delayed channel."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Literal, Self

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import ADDED, PartConfig, Surroundings
from surgsim.columns import width
from surgsim.compiled import as_parameter
from surgsim.models.config import Vec3
from surgsim.models.peg_board import PegBoardLayout
from surgsim.tasks.base import Feedback, TipCommand
from surgsim.tasks.command import command_of
from surgsim.tasks.success import RunColumns, Success
from surgsim.tasks.teleoperation_program import (
    GoalConfig,
    board_goals,
    conducted,
    goals_success,
    rings_success,
    way_points,
)
from surgsim.teleop.bilateral import BILATERAL
from surgsim.teleop.bilateral.base import BilateralConfig
from surgsim.teleop.bilateral.ends import describe_law
from surgsim.teleop.bilateral.passive_convex import PassiveConvexConfig
from surgsim.teleop.channel import DRAW, Channel, ChannelConfig, draw_packets
from surgsim.teleop.console import Console, ConsoleConfig, home_room_rad
from surgsim.teleop.goals import GOAL, Goal, goal_rows
from surgsim.teleop.hand import Hand, fill_action
from surgsim.teleop.mapping import MappingConfig, align, describe_mapping
from surgsim.teleop.messages import TANK
from surgsim.teleop.operator import OperatorConfig, describe_operator
from surgsim.teleop.receiver import ReceiverConfig, expect
from surgsim.teleop.roll import RollConfig, describe_roll
from surgsim.teleop.sight import (
    RING_ROW,
    SHOWN,
    SIGHT_COLUMNS,
    board_rows,
    describe_sight,
    picture_size,
    show_first,
)
from surgsim.teleop.tank import fill_tank
from surgsim.teleop.teleoperator import (
    COLUMNS,
    DRAWN,
    LAW_SIZE,
    Law,
    State,
    copies,
    places,
    teleoperate,
)
from surgsim.teleop.tremor_filter import TremorFilterConfig, describe_filter
from surgsim.tick.arrays import Command, task_signature
from surgsim.tick.blank import new_command, new_feedback
from surgsim.tick.overlay import laid_over, take
from surgsim.tick.python_part import PythonPart
from surgsim.tick.status import GOES_ON

_MOST_PERIODS = 4_000_000

if TYPE_CHECKING:
    AnyBilateral = BilateralConfig
else:
    AnyBilateral = BILATERAL.union()


class TeleoperationConfig(PartConfig):
    """Teleoperation through a delayed channel, by a simulated operator at a master console.

    Attributes:
        start_m: Where the tip is at first, world frame [m]; null: where it is in `start.q_rad`.
        program: What the operator does: `goals`, or the transfers of a `peg_board`.
        goals: The operator's goals, one after the other; without any it holds the handle still.
        board: Layout of the board for `peg_and_ring`; must be that of the `peg_board` in `props`.
        goal_timeout_s: After this the operator gives up a goal of `peg_and_ring` [s].
        duration_s: Longest time that it may take [s].
        time_limit_s: The operator must be done by then, else the run ends as `time_limit` and the task is not
            done [s]; null, or past `duration_s`: no limit.
        hold_end_s: Time at rest after the last goal [s].
        bilateral: What either side sends, what the hand feels and where the tip is led: a bilateral scheme.
        operator: Eyes, decisions and hand.
        console: The master console.
        mapping: Motion scaling and rotation between console and world.
        tremor_filter: What takes tremor off what the handle tells the remote side.
        roll: Whether the grip rolls the instrument.
        channel: The channel to the remote side, and the one back unless `channel_back` is given.
        channel_back: The channel back; null: as `channel`.
        video: The channel of the picture that the operator sees; null: it comes with the tip's state, by the
            channel back.
        receiver: How long a set point is believed, on both sides.
    """

    type: Literal["teleoperation"] = "teleoperation"
    start_m: Vec3 | None = None
    program: Literal["goals", "peg_and_ring"] = "goals"
    goals: tuple[GoalConfig, ...] = ()
    board: PegBoardLayout = PegBoardLayout()
    goal_timeout_s: PositiveFloat = 20.0
    duration_s: PositiveFloat = 60.0
    time_limit_s: Annotated[PositiveFloat | None, ADDED] = None
    hold_end_s: NonNegativeFloat = 1.0
    bilateral: AnyBilateral = PassiveConvexConfig()
    operator: OperatorConfig = OperatorConfig()
    console: ConsoleConfig = ConsoleConfig()
    mapping: MappingConfig = MappingConfig()
    tremor_filter: TremorFilterConfig = TremorFilterConfig()
    roll: RollConfig = RollConfig()
    channel: ChannelConfig = ChannelConfig()
    channel_back: ChannelConfig | None = None
    video: ChannelConfig | None = None
    receiver: ReceiverConfig = ReceiverConfig()

    @model_validator(mode="after")
    def _one_program(self) -> Self:
        if self.program == "peg_and_ring" and self.goals:
            raise ValueError("program 'peg_and_ring' makes its own goals: leave goals out")
        return self

    @model_validator(mode="after")
    def _there_are_rings_to_look_at(self) -> Self:
        if self.operator.sight.use and self.program != "peg_and_ring":
            raise ValueError("operator.sight looks at the rings of the program 'peg_and_ring'")
        return self

    @model_validator(mode="after")
    def _a_goal_s_roll_is_passed_on(self) -> Self:
        if not self.roll.use and any(goal.roll_deg for goal in self.goals):
            raise ValueError("roll_deg of a goal turns the grip alone: roll.use passes it on")
        return self

    @model_validator(mode="after")
    def _filter_fits_the_scheme(self) -> Self:
        if self.tremor_filter.type != "none" and self.bilateral.type != "passive_convex":
            raise ValueError(
                "a tremor_filter needs the bilateral scheme 'passive_convex', whose tanks book the work at "
                f"the handle: '{self.bilateral.type}' takes what the handle tells for the motion of its port"
            )
        return self

    @property
    def rolls_instrument(self) -> bool:
        """Whether the grip rolls the instrument."""
        return self.roll.use

    def check(self, scenario: Surroundings) -> None:
        """Refuse what does not fit the rest of the scenario.

        Raises:
            ValueError: If the console's steps do not fit the control period, the tremor filter does not fit
                it, the console has no room for the clutch's margin, or the board is not in `props`.
        """
        self.console.substeps(scenario.control_period_s)
        self.tremor_filter.sampled(scenario.control_period_s)
        margin, room = self.operator.clutch.stop_margin_rad, home_room_rad()
        if margin >= room:
            raise ValueError(
                f"operator.clutch.stop_margin_rad {margin:g} must be below {room:.3g}, "
                "the way from the console's home pose to its nearest stop"
            )
        if self.program != "peg_and_ring":
            return
        boards = [prop for prop in scenario.props if isinstance(prop, PegBoardLayout)]
        if len(boards) != 1:
            raise ValueError(f"program 'peg_and_ring' needs one peg_board in props, not {len(boards)}")
        keys = PegBoardLayout.model_fields
        other = [key for key in keys if getattr(self.board, key) != getattr(boards[0], key)]
        if other:
            raise ValueError(f"task.board is not the peg_board in props: {', '.join(other)} differ")

    def program_goals(self) -> tuple[Goal, ...]:
        """What the operator does."""
        if self.program == "peg_and_ring":
            return board_goals(self.board, self.goal_timeout_s)
        return tuple(goal.goal() for goal in self.goals)

    def build(
        self, start: Array, period_s: float = 0.001, seed: np.random.SeedSequence | None = None
    ) -> "Teleoperation":
        """The task from `start` (3,) [m]; everything random in it comes from `seed`."""
        return Teleoperation(self, np.array(start), period_s, seed or np.random.SeedSequence(0))

    def success(self, run: RunColumns) -> Success:
        """Whether every ring is on its peg, or every goal was reached, passively and with rest at the end."""
        if self.program == "peg_and_ring":
            return conducted(rings_success(run), run)
        return conducted(goals_success(run, self.goals), run)


class Teleoperation:
    """Both sides and the channels between them: `teleoperate`; the arm is the controller's.

    Attributes:
        kernel: status = kernel(gains, feedback, memory, out).
        gains: Its numbers: a `Law`, then the rows of the goals and of the mapping's changes, then a scheme's.
        memory: Its memory: a `State`, then the tables of `places`.
    """

    reacts = True
    kernel = staticmethod(teleoperate)

    def __init__(
        self, config: TeleoperationConfig, start: Array, period_s: float, seed: np.random.SeedSequence
    ) -> None:
        self._c, self._start, self._period, self._seed = config, start, period_s, seed
        self._goals = config.program_goals()
        self._channels = [config.channel, config.channel_back or config.channel]
        round_trip = sum(channel.delay_s for channel in self._channels)
        self._channels += [config.video] if config.video else []
        self._hand: Hand | None = None
        self._console = Console(config.console, period_s)
        most = min(config.duration_s / period_s, _MOST_PERIODS)
        lives = [channel.life(period_s, round(most)) for channel in self._channels]
        self._scheme = config.bilateral.build(period_s, round_trip)
        ends = self._scheme.memory_size if self._scheme else 0
        packets = [(life, copies(channel)) for life, channel in zip(lives, self._channels, strict=True)]
        self._looks = config.operator.sight.use
        rings = board_rows(config.board) if self._looks else np.zeros((0, RING_ROW))
        self.columns = (*COLUMNS, *SIGHT_COLUMNS) if self._looks else COLUMNS
        self._places = places(packets, ends, picture_size(len(rings)) if self._looks else 0)
        own = self._scheme.gains if self._scheme else np.zeros(0)
        rows = (goal_rows(self._goals).ravel(), config.mapping.change_rows().ravel(), rings.ravel())
        self.gains = np.concatenate([np.zeros(LAW_SIZE), *rows, own])
        self.memory = np.zeros(self._places.end)
        self._describe(lives)
        self.reset()

    @property
    def duration_s(self) -> float:
        """Longest time that it may take [s]."""
        return self._c.duration_s

    def reach(self) -> list[tuple[str, Array]]:
        """The ways between the goals."""
        return way_points(self._start, self._goals)

    def hold(self, hand: Hand) -> None:
        """Let `hand` take the simulated operator's place, from the next `reset` on."""
        self._hand = hand

    def look_at(self, places: Mapping[str, int]) -> None:
        """Where the rings are in the plant's columns."""
        if not self._looks:
            return
        law = laid_over(Law, self.gains).operator.operator.sight
        for ring in range(law.rings):
            self.gains[law.board + RING_ROW * ring + SHOWN] = places[f"ring{ring + 1}"]

    def force_acted_over(self, time_s: float) -> None:
        """The measured force is of the last `time_s` of each control period [s], of all of it until told."""
        laid_over(Law, self.gains).force_share = time_s / self._period

    def _describe(self, lives: Sequence[int]) -> None:
        """Fill the numbers; the mapping and what is of the hand come with `reset`."""
        c, law, at = self._c, laid_over(Law, self.gains), self._places
        near, far = law.operator, law.remote
        law.hold_end_s, law.start[:], law.force_share = c.hold_end_s, self._start, 1.0
        law.time_limit_s = math.inf if c.time_limit_s is None else c.time_limit_s
        for side in (near, far):
            side.period_s = self._period
            take(side.receiver, c.receiver)
            describe_roll(side.roll, c.roll)
            describe_law(side, c.bilateral, self._scheme)
        if self._scheme:
            begin = self.gains.size - self._scheme.gains.size
            for side, memory in ((near, at.operator_end), (far, at.remote_end)):
                side.scheme.gains, side.scheme.gain_count = begin, self._scheme.gains.size
                side.scheme.memory, side.scheme.memory_size = memory, self._scheme.memory_size
        near.start_tip[:] = self._start
        self._console.describe(near.console)
        forth, back = self._channels[:2]
        round_trip = forth.delay_s + (c.video or back).delay_s  # of what the eyes see
        self._noise_m = describe_operator(near.operator, c.operator, self._period, round_trip)
        near.operator.goals, near.operator.goal_count = LAW_SIZE, len(self._goals)
        near.operator.tremor, near.operator.scatter = at.tremor, at.scatter
        describe_mapping(near.mapping, c.mapping, self._period)
        describe_filter(near.tremor_filter, c.tremor_filter, self._period)
        near.mapping.changes = LAW_SIZE + GOAL * len(self._goals)
        near.operator.clutch.fade_s = c.mapping.clutch_fade_s
        self._describe_sight(lives[-1])
        lines = (
            (law.forth, far.receiver, at.forth_draws, at.forth_ring, at.forth_taken),
            (law.back, near.receiver, at.back_draws, at.back_ring, at.back_taken),
            (law.video, near.screen, at.video_draws, at.video_ring, at.video_taken),
        )
        law.has_video = near.has_video = c.video is not None
        take(near.screen, c.receiver)
        for (line, receiver, draws, ring, taken), config, life in zip(
            lines, self._channels, lives, strict=False
        ):
            line.delay_s, line.draws, line.ring = config.bounds()[0], draws, ring
            line.clock_rate, line.clock_skew_s = 1.0 + 1e-6 * config.clock_drift_ppm, config.clock_skew_s
            line.capacity = life * copies(config)
            line.cumulative = receiver.cumulative = config.energy == "cumulative"
            receiver.taken, receiver.window = taken, life

    def _describe_sight(self, life: int) -> None:
        """What the operator sees of the rings, in pictures that live so many periods."""
        if not self._looks:
            return
        law, at = laid_over(Law, self.gains).operator, self._places
        sight = law.operator.sight
        describe_sight(sight, self._c.operator.sight, self._c.board)
        sight.pictures, sight.kept, sight.seen, sight.aims = at.pictures, life, at.seen, at.aims
        sight.board = law.mapping.changes + self._c.mapping.change_rows().size

    def reset(self) -> None:
        """Handle at home, tip at its start, channels empty."""
        law, c = laid_over(Law, self.gains), self._c
        self.memory[:] = 0.0
        state, memory = laid_over(State, self.memory), self.memory
        near, far = state.operator, state.remote
        self._console.reset(law.operator.console, near.console)
        align(near.mapping, c.mapping, near.console.state.position, self._start)
        state.ends = bool(self._goals) or self._hand is not None
        near.in_python = self._hand is not None
        near.of_scheme = far.of_scheme = self._scheme is not None
        near.scale = 1.0
        for side_law, side in ((law.operator, near), (law.remote, far)):
            if side_law.passivity == TANK:
                fill_tank(side_law.tank, side.tank)
            expect(side_law.receiver, side.receiver, memory)
        if c.video is not None:
            expect(law.operator.screen, near.screen, memory)
        state.work.p[:] = far.reference[:] = self._start
        state.forth.drawn = state.back.drawn = state.video.drawn = DRAWN
        near.operator.shaken = near.operator.scattered = near.operator.sight.aimed = DRAWN
        if self._looks:
            show_first(law.operator.operator.sight, self.gains, near.operator.sight, memory, self._start)
        self._random = [np.random.default_rng(_child(self._seed, *key)) for key in _STREAMS]
        self.refill(1)

    def refill(self, ticks: int) -> None:
        """Draw ahead what the next `ticks` periods may need, at most `DRAWN`."""
        state, at = laid_over(State, self.memory), self._places
        operator = state.operator.operator
        used = [state.forth.drawn, state.back.drawn, operator.shaken, operator.scattered]
        used += [state.video.drawn] if self._c.video else []
        used += [operator.sight.aimed] if self._looks else []
        if DRAWN - max(used) >= ticks:
            return
        tremor, scatter, aims, *of_channels = self._random
        lines = zip(
            (state.forth, state.back, state.video),
            self._channels,
            of_channels,
            (at.forth_draws, at.back_draws, at.video_draws),
            strict=False,
        )

        def packets(channel: Channel, config: ChannelConfig, random: np.random.Generator) -> _Draw:
            return lambda rows: draw_packets(config, channel, random, rows, self._period)

        def shakes(rows: Array) -> None:
            rows[:] = self._noise_m * tremor.standard_normal(rows.shape)

        def misses(rows: Array) -> None:
            rows[:] = scatter.standard_normal(rows.shape)

        def errs(rows: Array) -> None:
            rows[:] = aims.standard_normal(rows.shape)

        def top_up(begin: int, size: int, used: int, draw: _Draw) -> int:
            left = DRAWN - used
            if left >= ticks:
                return used
            rows = self.memory[begin : begin + DRAWN * size].reshape(-1, size)
            rows[:left] = rows[used:].copy()
            draw(rows[left:])
            return 0

        for channel, config, random, begin in lines:
            channel.drawn = top_up(begin, DRAW, int(channel.drawn), packets(channel, config, random))
        operator.shaken = top_up(at.tremor, 3, int(operator.shaken), shakes)
        operator.scattered = top_up(at.scatter, 3, int(operator.scattered), misses)
        if self._looks:
            operator.sight.aimed = top_up(at.aims, 3, int(operator.sight.aimed), errs)

    def act(self) -> None:
        """Let the hand in Python act, in the midst of a period."""
        assert self._hand is not None
        side = laid_over(State, self.memory).operator
        command = self._hand.step(float(side.t_s), side.seen.copy(), side.console.state.copy())
        fill_action(side.hand, command)

    @property
    def picture_tick(self) -> int:
        """Tick whose picture is on the operator's screen: that of the newest packet; -1 before the first."""
        side = laid_over(State, self.memory).operator
        return int((side.screen if self._c.video else side.receiver).highest)

    def enter(self, entry: Array) -> None:
        """Let the kernel call the C function that enters `act` (1,), see `surgsim.tick.python_part`."""
        laid_over(Law, self.gains).operator.entry[:] = entry

    def command(self, t_s: float, feedback: Feedback | None = None) -> TipCommand:
        """Step both sides to `t_s` [s]; without feedback the tip is taken to be at its start, untouched."""
        told, kernel = new_feedback(), as_parameter(teleoperate, task_signature())
        told.t_s, told.p_WT[:] = t_s, self._start if feedback is None else feedback.p_WT
        told.v_WT[:] = 0.0 if feedback is None else feedback.v_WT
        told.f_T[:] = 0.0 if feedback is None else feedback.f_T
        told.R_WT[:] = np.eye(3) if feedback is None else feedback.R_WT
        told.w_WT[:] = 0.0 if feedback is None else feedback.w_WT
        self.refill(1)
        if self._hand is None:
            kernel(self.gains, told, self.memory, self._out)
            return command_of(self._out)
        before, entered = laid_over(Law, self.gains).operator.entry.copy(), PythonPart(self.act)
        self.enter(entered.gains)
        status = kernel(self.gains, told, self.memory, self._out)
        self.enter(before)
        if status != GOES_ON:
            error = entered.raised()
            assert error is not None, f"status {status} and no error"
            raise error
        return command_of(self._out)

    @cached_property
    def _out(self) -> Command:
        return new_command()

    def values(self) -> Array:
        """Values of `columns` at the last `command`."""
        values: Array = self._out.values[: width(self.columns)].copy()
        return values

    def finished(self, t_s: float) -> bool:
        """Whether the operator has been done for `hold_end_s`; a simulated one without goals holds on."""
        law, state = laid_over(Law, self.gains), laid_over(State, self.memory)
        return bool(state.ends and state.is_done and t_s >= state.done_s + law.hold_end_s)


_Draw = Callable[[Array], None]
_STREAMS = ((0, 0), (0, 1), (0, 2), (1,), (2,), (3,))
"""Children of the seed: tremor, scatter, aim, packets to the remote side, back, and of the picture."""


def _child(seed: np.random.SeedSequence, *key: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *key))
