"""Both sides and the channels between them, as one kernel.

        x_o, v_o, jaw ── channel ──▶ v_d = trust (v + k (x - p_WT)),  budget T - epsilon ──▶ controller
        hand ◀── K_v (p_WT(t - delta) - x_o) ◀── channel ── p_WT, force, energy ◀── arm

The numbers are a `Law`, then the rows of goals and of changes of scale; the memory is a `State`, then the
tables of `Places`.
"""

import math
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

from surgsim.array import Array
from surgsim.columns import scalar, vector, width
from surgsim.compiled import compiled
from surgsim.teleop.account import ACCOUNT_COLUMNS, fill_account
from surgsim.teleop.channel import DRAW, PACKET, Channel, ChannelConfig, ChannelLaw, send
from surgsim.teleop.mapping import motion_to_remote
from surgsim.teleop.messages import CONTENT, FORCE, POSITION, SCHEME, TANK
from surgsim.teleop.operator_side import (
    OPERATOR_COLUMNS,
    OperatorSide,
    OperatorSideLaw,
    fill_operator_columns,
    look,
    step_operator_side,
)
from surgsim.teleop.remote_side import (
    REMOTE_COLUMNS,
    RemoteSide,
    RemoteSideLaw,
    fill_remote_columns,
    lead_roll,
    step_remote_side,
)
from surgsim.teleop.sight import fill_sight_columns, take_picture
from surgsim.teleop.tip_work import TipWork, add_tip_work
from surgsim.tick.arrays import FINISHED, OUT_OF_TIME, Command, Feedback, Record
from surgsim.tick.overlay import overlay
from surgsim.tick.status import GOES_ON

COLUMNS = (
    *OPERATOR_COLUMNS,
    *REMOTE_COLUMNS,
    *ACCOUNT_COLUMNS,
    vector("velocity_issued", "m_per_s"),
    scalar("setpoint_age", "s"),
)
_REMOTE = width(OPERATOR_COLUMNS)
_ACCOUNT = _REMOTE + width(REMOTE_COLUMNS)
_ISSUED = _ACCOUNT + width(ACCOUNT_COLUMNS)
_AGE = _ISSUED + 3
_SIGHT = _AGE + 1
DRAWN = 1024
"""So many periods are drawn ahead at most."""


class Law(Record):
    """All numbers of a teleoperation but the goals and the changes of scale.

    Attributes:
        hold_end_s: Time at rest after the operator is done [s].
        time_limit_s: Time by which it must be done [s]; infinite without a limit.
        force_share: Share of a control period, its last, over which the measured force acted.
        start: The tip's place at first (3,) [m].
        operator: The operator's side.
        remote: The remote side.
        forth: The channel to the remote side.
        back: The channel from it.
        has_video: Whether the picture has a channel of its own.
        video: That channel.
    """

    SHAPES: ClassVar[dict[str, str]] = {"start": "3"}
    hold_end_s: float
    time_limit_s: float
    force_share: float
    start: Array
    operator: OperatorSideLaw
    remote: RemoteSideLaw
    forth: ChannelLaw
    back: ChannelLaw
    has_video: int
    video: ChannelLaw


class State(Record):
    """All that a teleoperation remembers but tables and the console's own model.

    Attributes:
        ends: Whether it ends when the operator is done.
        is_done: Whether the operator is done.
        done_s: Since when [s].
        velocity: v_d of the last period (3,) [m/s].
        content: The message of the remote side, twelve numbers.
        operator: The operator's side.
        remote: The remote side.
        forth: The channel to the remote side.
        back: The channel from it.
        video: That of the picture.
        work: Of the tip.
    """

    SHAPES: ClassVar[dict[str, str]] = {"velocity": "3", "content": str(CONTENT)}
    ends: int
    is_done: int
    done_s: float
    velocity: Array
    content: Array
    operator: OperatorSide
    remote: RemoteSide
    forth: Channel
    back: Channel
    video: Channel
    work: TipWork


LAW, LAW_SIZE = overlay(Law)
STATE, STATE_SIZE = overlay(State)


class Places(NamedTuple):
    """Where the tables in the memory begin.

    Attributes:
        forth_draws: What happens to the packets to the remote side (DRAWN, 3).
        back_draws: To those from it.
        video_draws: To those of the picture.
        tremor: Noise of the tremor (DRAWN, 3) [m].
        scatter: Of the movements (DRAWN, 3).
        aims: Of the aim (DRAWN, 3); as the next two, nothing where the operator does not look at rings.
        pictures: Pictures that are kept.
        seen: The picture that is seen.
        forth_taken: Numbers of the packets that the remote side took.
        back_taken: That the operator's side took.
        video_taken: That the operator's screen took.
        forth_ring: Packets under way to the remote side.
        back_ring: From it.
        video_ring: Of the picture.
        operator_end: Memory of the bilateral scheme at the operator's end.
        remote_end: At the remote one.
        end: Length of the memory.
    """

    forth_draws: int
    back_draws: int
    video_draws: int
    tremor: int
    scatter: int
    aims: int
    pictures: int
    seen: int
    forth_taken: int
    back_taken: int
    video_taken: int
    forth_ring: int
    back_ring: int
    video_ring: int
    operator_end: int
    remote_end: int
    end: int


def places(packets: Sequence[tuple[int, int]], scheme: int = 0, picture: int = 0) -> Places:
    """Places for channels whose packets live so many periods, in so many copies, for a scheme and pictures.

    Args:
        packets: For each channel how many periods a packet may live, and in how many copies.
        scheme: Numbers of a scheme's end.
        picture: Numbers of a picture; they come by the last channel.
    """
    every = (*packets, *[(0, 0)] * (3 - len(packets)))
    sizes = (
        *(DRAW * DRAWN if life else 0 for life, _ in every),
        *(3 * DRAWN, 3 * DRAWN),
        *((3 * DRAWN, picture * packets[-1][0], picture) if picture else (0, 0, 0)),
        *(life for life, _ in every),
        *(PACKET * life * copied for life, copied in every),
        *(scheme, scheme),
    )
    begins = [STATE_SIZE]
    for size in sizes:
        begins.append(begins[-1] + size)
    return Places(*begins)


def copies(config: ChannelConfig) -> int:
    """How often a packet can be under way at a time."""
    return 2 if config.duplicate else 1


@compiled
def teleoperate(gains: Array, feedback: Feedback, memory: Array, out: Command) -> int:
    """One control period of both sides and of the channels between them.

    The command's position, to which `tip_error` refers, is the master's as received: the place that the
    operator pointed to one channel's delay ago. The arm is asked for the velocity alone, so the error holds
    what the slack, the walls, the budget and lost packets have left out.
    """
    law, state, t_s = gains[:LAW_SIZE].view(LAW)[0], memory[:STATE_SIZE].view(STATE)[0], feedback.t_s
    operator, remote = state.operator, state.remote
    operator.t_s = t_s
    if law.has_video:
        look(law.operator, operator, law.video, state.video, memory)
    status, energy = step_operator_side(law.operator, gains, operator, law.back, state.back, memory)
    if status != GOES_ON:
        return status
    send(law.forth, state.forth, memory, t_s, operator.content, energy)
    work = add_tip_work(state.work, feedback.p_WT, feedback.f_T, law.force_share)
    p, force = state.content[POSITION : POSITION + 3], state.content[FORCE : FORCE + 3]
    for i in range(3):
        p[i], force[i] = feedback.p_WT[i], -feedback.f_T[i]
    status, energy = step_remote_side(
        law.remote, gains, remote, law.forth, state.forth, memory, t_s, p, feedback.v_WT, force, work
    )
    if status != GOES_ON:
        return status
    lead_roll(law.remote, remote, feedback.R_WT, feedback.w_WT)
    if law.remote.passivity == SCHEME:
        state.content[:] = remote.end.content
    if law.operator.operator.sight.use:
        take_picture(law.operator.operator.sight, gains, feedback, memory, state.back.next_number)
    send(law.back, state.back, memory, t_s, state.content, energy)
    if law.has_video:
        send(law.video, state.video, memory, t_s, state.content, 0.0)
    if operator.hand.done and not state.is_done:
        state.is_done, state.done_s = 1, t_s
    over = state.ends and state.is_done and t_s >= state.done_s + law.hold_end_s
    out.finished = FINISHED if over else 0
    if state.ends and not state.is_done and t_s >= law.time_limit_s:
        out.finished = OUT_OF_TIME
    _tell(law, state, feedback, out)
    _record(law, state, t_s, out.values)
    return GOES_ON


@compiled
def _tell(law: Law, state: State, feedback: Feedback, out: Command) -> None:
    """The remote side's command to the controller."""
    remote, limited = state.remote, law.remote.passivity == TANK
    known = remote.receiver.highest >= 0
    for i in range(3):
        out.p_WTd[i] = remote.receiver.content[POSITION + i] if known else law.start[i]
        out.v_WTd[i] = remote.velocity[i]
        out.a_WTd[i] = (remote.velocity[i] - state.velocity[i]) / law.remote.period_s
        state.velocity[i] = remote.velocity[i]
        out.budget_f_T[i] = feedback.f_T[i] if limited else 0.0
    out.jaw, out.budget_j, out.roll_rate = remote.jaw, remote.budget_j, remote.roll_rate


@compiled
def _record(law: Law, state: State, t_s: float, values: Array) -> None:
    """Values of `COLUMNS`."""
    operator, remote = state.operator, state.remote
    fill_operator_columns(operator, values)
    fill_remote_columns(remote, values[_REMOTE:])
    fill_account(law.operator, operator, law.remote, remote, state.forth, state.back, values[_ACCOUNT:])
    velocity = operator.console.state.velocity
    motion_to_remote(operator.mapping, velocity, values[_ISSUED : _ISSUED + 3])
    values[_AGE] = t_s - remote.receiver.sent_s if remote.receiver.highest >= 0 else math.nan
    if law.operator.operator.sight.use:
        fill_sight_columns(operator.operator.sight, values[_SIGHT:])
