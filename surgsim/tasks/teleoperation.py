"""Teleoperation: the tip follows a master console through a delayed channel."""

from collections.abc import Sequence
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat, PositiveFloat, model_validator

from surgsim.catalog import PartConfig
from surgsim.columns import scalar, vector
from surgsim.models.config import Vec3
from surgsim.models.peg_board import PegBoardLayout
from surgsim.tasks.base import EnergyBudget, Feedback, TipCommand
from surgsim.tasks.success import RunColumns, Success
from surgsim.tasks.teleoperation_program import (
    GoalConfig,
    board_goals,
    goals_success,
    rings_success,
    way_points,
)
from surgsim.teleop.account import ACCOUNT_COLUMNS, account
from surgsim.teleop.channel import Channel, ChannelConfig
from surgsim.teleop.console import ConsoleConfig
from surgsim.teleop.mapping import MappingConfig
from surgsim.teleop.messages import OperatorMessage, PassivityMode, RemoteMessage
from surgsim.teleop.operator import Goal, Hand, OperatorConfig
from surgsim.teleop.operator_side import OPERATOR_COLUMNS, OperatorOutput, OperatorSide, OperatorSideConfig
from surgsim.teleop.passivity_control import PassivityControlConfig
from surgsim.teleop.receiver import ReceiverConfig
from surgsim.teleop.remote_side import (
    REMOTE_COLUMNS,
    RemoteMeasurement,
    RemoteOutput,
    RemoteSide,
    RemoteSideConfig,
)
from surgsim.teleop.tank import TankConfig
from surgsim.teleop.tip_work import TipWork

Array = NDArray[np.float64]


class TeleoperationConfig(PartConfig):
    """Teleoperation through a delayed channel, by a simulated operator at a master console.

    Attributes:
        start_m: Where the tip is at first, world frame [m]; null: where it is in `start.q_rad`.
        program: What the operator does: `goals`, or the transfers of a `peg_board`.
        goals: The operator's goals, one after the other; without any it holds the handle still.
        board: Layout of the board for `peg_and_ring`; must be that of the `peg_board` in `props`.
        goal_timeout_s: After this the operator gives up a goal of `peg_and_ring` [s].
        duration_s: Longest time that it may take [s].
        hold_end_s: Time at rest after the last goal [s].
        passivity: Energy tanks, the time-domain passivity controller, or nothing.
        stiffness_n_per_m: K_v of the force law, per metre of handle motion [N/m].
        refill_damping_ns_per_mj: Damper on the handle per joule that its tank lacks.
        drift_gain_per_s: Pull of the tip to the master's position beside its velocity; 0: none [1/s].
        drift_speed_m_per_s: Limit of that pull [m/s].
        operator: Eyes, decisions and hand.
        console: The master console.
        mapping: Motion scaling and rotation between console and world.
        channel: The channel to the remote side, and the one back unless `channel_back` is given.
        channel_back: The channel back; null: as `channel`.
        receiver: How long a set point is believed, on both sides.
        tanks: The energy tank of each side.
        passivity_control: Limits of the passivity controller, on both sides.
    """

    type: Literal["teleoperation"] = "teleoperation"
    start_m: Vec3 | None = None
    program: Literal["goals", "peg_and_ring"] = "goals"
    goals: tuple[GoalConfig, ...] = ()
    board: PegBoardLayout = PegBoardLayout()
    goal_timeout_s: PositiveFloat = 20.0
    duration_s: PositiveFloat = 60.0
    hold_end_s: NonNegativeFloat = 1.0
    passivity: PassivityMode = "tank"
    stiffness_n_per_m: NonNegativeFloat = 60.0
    refill_damping_ns_per_mj: NonNegativeFloat = 20.0
    drift_gain_per_s: NonNegativeFloat = 2.0
    drift_speed_m_per_s: PositiveFloat = 0.02
    operator: OperatorConfig = OperatorConfig()
    console: ConsoleConfig = ConsoleConfig()
    mapping: MappingConfig = MappingConfig()
    channel: ChannelConfig = ChannelConfig()
    channel_back: ChannelConfig | None = None
    receiver: ReceiverConfig = ReceiverConfig()
    tanks: TankConfig = TankConfig()
    passivity_control: PassivityControlConfig = PassivityControlConfig()

    @model_validator(mode="after")
    def _one_program(self) -> Self:
        if self.program == "peg_and_ring" and self.goals:
            raise ValueError("program 'peg_and_ring' makes its own goals: leave goals out")
        return self

    def check(self, control_period_s: float, props: Sequence[Any]) -> None:
        """Refuse what does not fit the rest of the scenario.

        Raises:
            ValueError: If the console's steps do not fit the control period, or the board is not in `props`.
        """
        self.console.substeps(control_period_s)
        if self.program != "peg_and_ring":
            return
        boards = [prop for prop in props if isinstance(prop, PegBoardLayout)]
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
        """Whether every ring is on its peg, or every goal was reached."""
        if self.program == "peg_and_ring":
            return rings_success(run)
        return goals_success(run, len(self.goals))

    def operator_side(self) -> OperatorSideConfig:
        """What the operator's side consists of."""
        return OperatorSideConfig(
            stiffness_n_per_m=self.stiffness_n_per_m,
            refill_damping_ns_per_mj=self.refill_damping_ns_per_mj,
            passivity=self.passivity,
            mapping=self.mapping,
            console=self.console,
            operator=self.operator,
            receiver=self.receiver,
            tank=self.tanks,
            control=self.passivity_control,
        )

    def remote_side(self) -> RemoteSideConfig:
        """What the remote side consists of, but for the arm."""
        return RemoteSideConfig(
            drift_gain_per_s=self.drift_gain_per_s,
            drift_speed_m_per_s=self.drift_speed_m_per_s,
            passivity=self.passivity,
            receiver=self.receiver,
            tank=self.tanks,
            control=self.passivity_control,
        )


class Teleoperation:
    """One tick of both sides and of the channels between them; the arm is the controller's.

        x_o, v_o, jaw ── channel ──▶ v_d = trust (v + k (x - p_WT)),  budget T - epsilon ──▶ controller
        hand ◀── K_v (p_WT(t - delta) - x_o) ◀── channel ── p_WT, force, energy ◀── arm

    The command's position, to which `tip_error` refers, is the master's as received: the place that the
    operator pointed to one channel's delay ago. The arm is asked for the velocity alone, so the error holds
    what the slack, the walls, the budget and lost packets have left out.
    """

    reacts = True
    columns = (
        *OPERATOR_COLUMNS,
        *REMOTE_COLUMNS,
        *ACCOUNT_COLUMNS,
        vector("velocity_issued", "m_per_s"),
        scalar("setpoint_age", "s"),
    )

    def __init__(
        self, config: TeleoperationConfig, start: Array, period_s: float, seed: np.random.SeedSequence
    ) -> None:
        self._c, self._start, self._period = config, start, period_s
        self._seed = seed
        self._goals = config.program_goals()
        self._hand: Hand | None = None
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

    def reset(self) -> None:
        """Handle at home, tip at its start, channels empty."""
        c, seed = self._c, self._seed
        operator, forth, back = (
            np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, i)) for i in range(3)
        )
        channel_back = c.channel_back or c.channel
        self._forth: Channel[OperatorMessage] = Channel(c.channel, np.random.default_rng(forth))
        self._back: Channel[RemoteMessage] = Channel(channel_back, np.random.default_rng(back))
        self._near = OperatorSide(
            c.operator_side(),
            self._goals,
            self._start,
            channel_back.energy,
            operator,
            self._hand,
            self._period,
        )
        self._far = RemoteSide(c.remote_side(), self._start, c.channel.energy, self._period)
        self._work = TipWork(self._start)
        self._v_d = np.zeros(3)
        self._done_s: float | None = None
        self._values = np.zeros(sum(len(block.columns) for block in self.columns))

    def command(self, t_s: float, feedback: Feedback | None = None) -> TipCommand:
        """Step both sides to `t_s` [s]; without feedback the tip is taken to be at its start, untouched."""
        p, f = (self._start, np.zeros(3)) if feedback is None else (feedback.p_WT, feedback.f_T)
        sent = self._near.step(t_s, self._back.receive(t_s))
        self._forth.send(t_s, sent.message, sent.energy_j)
        measured = RemoteMeasurement(position=p, force=-f, work_j=self._work.add(p, f))
        order = self._far.step(t_s, self._forth.receive(t_s), measured)
        self._back.send(t_s, order.message, order.energy_j)
        if sent.hand.done and self._done_s is None:
            self._done_s = t_s
        return self._told(t_s, sent, order, f)

    def values(self) -> Array:
        """Values of `columns` at the last command."""
        return self._values

    def finished(self, t_s: float) -> bool:
        """Whether the operator has been done for `hold_end_s`; a simulated one without goals holds on."""
        ends = bool(self._goals) or self._hand is not None
        return ends and self._done_s is not None and t_s >= self._done_s + self._c.hold_end_s

    def _told(self, t_s: float, sent: OperatorOutput, order: RemoteOutput, f_T: Array) -> TipCommand:
        newest = self._far.receiver.newest
        self._values = np.array(
            (
                *self._near.signals(),
                *self._far.signals(),
                *account(self._near, self._far, self._forth, self._back),
                *sent.message.velocity,
                np.nan if newest is None else t_s - newest.sent_s,
            )
        )
        a_d = (order.velocity - self._v_d) / self._period
        self._v_d = order.velocity
        limited = self._c.passivity == "tank"
        return TipCommand(
            p_WTd=self._start if newest is None else newest.content.position,
            v_WTd=order.velocity,
            a_WTd=a_d,
            jaw=order.jaw,
            budget=EnergyBudget(most_j=order.budget_j, f_T=f_T) if limited else None,
        )
