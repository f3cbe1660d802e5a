"""The remote side: set points for the arm, its energy budget, tank or passivity controller."""

import math
from typing import ClassVar

from surgsim.array import Array
from surgsim.columns import scalar, vector
from surgsim.compiled import compiled
from surgsim.teleop.bilateral.base import End
from surgsim.teleop.bilateral.ends import CalledScheme, ask, see
from surgsim.teleop.channel import Channel, ChannelLaw
from surgsim.teleop.messages import JAW, OFF, POSITION, ROLL, ROLL_RATE, SCHEME, TDPA, VELOCITY
from surgsim.teleop.passivity_control import (
    PassivityLaw,
    PortEnergy,
    admittance_control,
    compensate_drift,
    coordinating_force,
    keep_lead,
    observe,
    observed,
)
from surgsim.teleop.receiver import Receiver, ReceiverLaw, receive, trust
from surgsim.teleop.roll import RollLaw, rate_about, roll_rate
from surgsim.teleop.tank import Tank, TankLaw, budget, exchange, level, send_surplus
from surgsim.tick.algebra import dot, norm
from surgsim.tick.arrays import Record
from surgsim.tick.status import GOES_ON

REMOTE_COLUMNS = (
    scalar("tank_remote", "j"),
    scalar("tank_remote_overflow", "j"),
    scalar("tank_remote_deficit", "j"),
    scalar("tank_remote_sent", "j"),
    scalar("tank_remote_received", "j"),
    scalar("observer_remote", "j"),
    scalar("budget", "j"),
    scalar("environment_work", "j"),
    scalar("setpoint_trust"),
    scalar("late_packets"),
    scalar("duplicate_packets"),
    vector("velocity_command", "m_per_s"),
    scalar("jaw"),
    scalar("roll_command", "rad"),
    scalar("roll", "rad"),
)


class RemoteSideLaw(Record):
    """Numbers of the remote side.

    Attributes:
        passivity: TANK, TDPA or OFF; SCHEME: the velocity is the scheme's.
        period_s: Control period [s].
        drift_gain_per_s: Pull of the tip to the master's position beside its velocity.
        drift_speed_m_per_s: Limit of that pull.
        receiver: Of what comes from the operator's side.
        tank: The energy tank.
        control: The passivity controller.
        scheme: The bilateral scheme.
        roll: Of the instrument's roll.
    """

    passivity: int
    period_s: float
    drift_gain_per_s: float
    drift_speed_m_per_s: float
    receiver: ReceiverLaw
    tank: TankLaw
    control: PassivityLaw
    scheme: CalledScheme
    roll: RollLaw


class RemoteSide(Record):
    """State of the remote side.

    Attributes:
        environment_j: Energy that the tip gave to its environment [J].
        trust: In the set point, from 0 to 1.
        jaw: How far the jaws close.
        roll: Roll of the instrument since the start [rad].
        roll_rate: Commanded [rad/s].
        budget_j: Right side of the passivity row, T - epsilon [J]; infinite without a tank.
        wanted: Velocity before the passivity controller (3,) [m/s].
        velocity: v_d (3,) [m/s].
        gap: From the tip, or its reference, to where the master is (3,) [m].
        reference: The integral of v_d, for the passivity controller (3,) [m].
        force: Force at the remote port (3,) [N].
        receiver: Of what comes from the operator's side.
        tank: The energy tank.
        port: The passivity observer.
        of_scheme: Whether the energy is the bilateral scheme's.
        end: What a bilateral scheme sees and answers.
    """

    SHAPES: ClassVar[dict[str, str]] = {
        name: "3" for name in ("wanted", "velocity", "gap", "reference", "force")
    }
    environment_j: float
    trust: float
    jaw: float
    roll: float
    roll_rate: float
    budget_j: float
    wanted: Array
    velocity: Array
    gap: Array
    reference: Array
    force: Array
    receiver: Receiver
    tank: Tank
    port: PortEnergy
    of_scheme: int
    end: End


@compiled
def _master_s_order(law: RemoteSideLaw, side: RemoteSide, position: Array, t_s: float) -> bool:
    """Trust, jaw and the master's velocity as `side.wanted`; whether anything was received yet.

    `side.gap` is filled with how far the master is from `position` (3,) [m].
    """
    side.trust = trust(law.receiver, side.receiver, t_s)
    if side.receiver.highest < 0:
        return False
    order = side.receiver.content
    side.jaw = order[JAW]
    for i in range(3):
        side.wanted[i] = side.trust * order[VELOCITY + i]
        side.gap[i] = order[POSITION + i] - position[i]
    return True


@compiled
def _set_point(law: RemoteSideLaw, side: RemoteSide, position: Array, t_s: float) -> None:
    """v_d = trust (v + drift_gain (x - x_r)), with the master's velocity v and position x as received.

    The second term keeps lost packets from adding up to an offset, and is cut at `drift_speed_m_per_s`. With
    drift_gain 0 the command is the paper's pure velocity.
    """
    if not _master_s_order(law, side, position, t_s):
        return
    speed = law.drift_gain_per_s * norm(side.gap)
    cut = law.drift_speed_m_per_s / speed if speed > law.drift_speed_m_per_s else 1.0
    for i in range(3):
        side.wanted[i] += side.trust * (cut * (law.drift_gain_per_s * side.gap[i]))
        side.velocity[i] = side.wanted[i]


@compiled
def _observed_set_point(
    law: RemoteSideLaw, side: RemoteSide, position: Array, velocity: Array, t_s: float, received_j: float
) -> float:
    """v_d as time-domain passivity control lets it through; the energy that enters the channel here [J].

        v_d = trust (v + c drift_gain (x - x_d)) - alpha F,   x_d the integral of v_d

    The factor c keeps the pull to what the received energy pays for, where the paper closes the whole gap in
    a period: steps of the velocity, which an arm with limits answers with forces of its own.
    """
    control, port, force = law.control, side.port, side.force
    port.received_j += received_j
    keep_lead(control, side.reference, position)
    if control.coordinates:
        coordinating_force(control, side.reference, position, side.velocity, velocity, force)
    if _master_s_order(law, side, side.reference, t_s):
        for i in range(3):
            side.gap[i] *= side.trust * law.drift_gain_per_s
        compensate_drift(port, side.gap, force, law.period_s, law.drift_speed_m_per_s, side.wanted)
    admittance_control(control, port, side.wanted, force, law.period_s, side.velocity)
    work = law.period_s * dot(force, side.wanted)
    observe(port, work, work - law.period_s * dot(force, side.velocity), 0.0)
    for i in range(3):
        side.reference[i] += law.period_s * side.velocity[i]
    return max(-work, 0.0)


@compiled
def _follow(
    law: RemoteSideLaw,
    gains: Array,
    side: RemoteSide,
    memory: Array,
    t_s: float,
    received_j: float,
    position: Array,
    velocity: Array,
    work_j: float,
) -> int:
    """The velocity of the bilateral scheme, and its message."""
    end = side.end
    see(law.receiver, side.receiver, end, t_s, law.period_s, received_j)
    side.trust = end.trust
    if side.receiver.highest >= 0:
        side.jaw = side.receiver.content[JAW]
    end.work_j = work_j
    for i in range(3):
        end.position[i], end.velocity[i], end.force[i] = position[i], velocity[i], side.force[i]
    status = ask(law.scheme.follow, law.scheme, gains, end, memory)
    for i in range(3):
        side.velocity[i] = end.command[i]
    return status


@compiled
def step_remote_side(
    law: RemoteSideLaw,
    gains: Array,
    side: RemoteSide,
    line: ChannelLaw,
    channel: Channel,
    memory: Array,
    t_s: float,
    position: Array,
    velocity: Array,
    force: Array,
    work_j: float,
) -> tuple[int, float]:
    """Receive, book the environment's work, set point: the command for the period from `t_s`.

    Args:
        law: Numbers of the side.
        gains: All numbers, among them those of a bilateral scheme.
        side: Its state, with the command in it afterwards.
        line: Numbers of the channel from the operator's side.
        channel: The channel.
        memory: All memory, among it packets.
        t_s: Time [s].
        position: Tip position now (3,) [m].
        velocity: Tip velocity now (3,) [m/s].
        force: Force of the tip on its environment now (3,) [N].
        work_j: Energy that the tip gave to its environment in the last period; negative if it absorbed some.

    Returns:
        A status, and the energy to be sent [J].
    """
    before = side.receiver.highest
    received = receive(law.receiver, side.receiver, line, channel, memory, t_s)
    side.end.fresh = 1 if side.receiver.highest > before else 0
    side.environment_j += work_j
    side.budget_j = math.inf
    for i in range(3):
        side.force[i] = force[i]
    if law.passivity == SCHEME:
        status = _follow(law, gains, side, memory, t_s, received, position, velocity, work_j)
        return status, side.end.energy_j
    if law.passivity == TDPA:
        return GOES_ON, _observed_set_point(law, side, position, velocity, t_s, received)
    _set_point(law, side, position, t_s)
    if law.passivity == OFF:
        return GOES_ON, 0.0
    exchange(law.tank, side.tank, work_j, received)
    energy = send_surplus(law.tank, side.tank, law.period_s)
    side.budget_j = budget(law.tank, side.tank)
    return GOES_ON, energy


@compiled
def lead_roll(law: RemoteSideLaw, side: RemoteSide, R_WT: Array, w_WT: Array) -> None:
    """Add up the instrument's roll about its shaft, and set the rate for the period.

    Args:
        law: Numbers of the side.
        side: Has received and trusts already.
        R_WT: Orientation of the instrument as measured (3, 3).
        w_WT: Its angular velocity (3,) [rad/s].
    """
    order = side.receiver.content
    side.roll += law.period_s * rate_about(R_WT, 2, w_WT)
    side.roll_rate = roll_rate(law.roll, side.trust, order[ROLL_RATE], order[ROLL], side.roll)


@compiled
def fill_remote_columns(side: RemoteSide, out: Array) -> None:
    """Values of `REMOTE_COLUMNS`, SI units by their suffix."""
    tank, receiver = side.tank, side.receiver
    out[0], out[1], out[2], out[3] = level(tank), tank.overflow_j, tank.deficit_j, tank.sent_j
    out[4], out[5], out[6] = receiver.received_j, observed(side.port), side.budget_j
    out[7], out[8] = side.environment_j, side.trust
    out[9], out[10] = receiver.late_packets, receiver.duplicate_packets
    for i in range(3):
        out[11 + i] = side.velocity[i]
    out[14], out[15], out[16] = side.jaw, receiver.content[ROLL], side.roll
    if side.of_scheme:
        end = side.end
        out[0], out[1], out[2], out[5] = end.stored_j, end.burnt_j, end.deficit_j, end.observed_j
