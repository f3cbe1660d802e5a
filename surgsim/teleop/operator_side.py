"""The operator's side: console, hand, force law, tank or passivity controller, or a scheme's end."""

from typing import ClassVar

from surgsim.array import Array
from surgsim.columns import scalar, vector
from surgsim.compiled import compiled
from surgsim.teleop.bilateral.base import End
from surgsim.teleop.bilateral.ends import CalledScheme, ask, see
from surgsim.teleop.channel import Channel, ChannelLaw
from surgsim.teleop.console import ConsoleLaw, ConsoleMemory, renderable, step_console
from surgsim.teleop.hand import HandAction
from surgsim.teleop.mapping import (
    Mapping,
    MappingLaw,
    feedback_force,
    force_to_console,
    force_to_remote,
    motion_to_remote,
    remap,
    to_remote,
)
from surgsim.teleop.messages import CONTENT, JAW, OFF, POSITION, ROLL, ROLL_RATE, SCHEME, TDPA, VELOCITY
from surgsim.teleop.operator import Operator, OperatorLaw, operate
from surgsim.teleop.passivity_control import PassivityLaw, PortEnergy, impedance_control, observe, observed
from surgsim.teleop.receiver import Receiver, ReceiverLaw, receive
from surgsim.teleop.roll import RollLaw, rate_about
from surgsim.teleop.tank import Tank, TankLaw, affordable, exchange, level, send_surplus
from surgsim.teleop.tremor_filter import TremorFilter, TremorFilterLaw, steady
from surgsim.tick.algebra import dot
from surgsim.tick.arrays import Record
from surgsim.tick.python_part import enter
from surgsim.tick.status import GOES_ON

OPERATOR_COLUMNS = (
    scalar("tank_operator", "j"),
    scalar("tank_operator_overflow", "j"),
    scalar("tank_operator_deficit", "j"),
    scalar("tank_operator_sent", "j"),
    scalar("tank_operator_received", "j"),
    scalar("observer_operator", "j"),
    scalar("rendered_work", "j"),
    scalar("hand_work", "j"),
    scalar("console_kinetic", "j"),
    scalar("console_potential", "j"),
    scalar("console_motor_work", "j"),
    scalar("console_damping", "j"),
    scalar("console_friction", "j"),
    scalar("console_residual", "j"),
    scalar("force_scale"),
    vector("handle", "m"),
    vector("handle_velocity", "m_per_s"),
    vector("master_force", "n"),
    vector("hand_force", "n"),
    vector("hand_intended", "m"),
    scalar("jaw_command"),
    scalar("goal"),
    scalar("goals_missed"),
    scalar("operator_done"),
    scalar("handle_stop"),
    scalar("clutch_engaged"),
    scalar("motion_scale"),
)


class OperatorSideLaw(Record):
    """Numbers of the operator's side.

    Attributes:
        passivity: TANK, TDPA or OFF; SCHEME: the force is the scheme's.
        period_s: Control period [s].
        stiffness_n_per_m: K_v of the force law, per metre of handle motion.
        refill_damping_ns_per_mj: Damper on the handle per joule that its tank lacks.
        entry: What enters the hand in Python, see `surgsim.tick.python_part` (1,).
        start_tip: The tip until something is received (3,) [m].
        console: The console.
        operator: The simulated operator.
        mapping: Of the mapping between console and world.
        tremor_filter: Of what the handle tells the remote side.
        roll: Of the instrument's roll.
        receiver: Of what comes from the remote side.
        has_video: Whether the picture has a channel of its own.
        screen: The receiver of the picture.
        tank: The energy tank.
        control: The passivity controller.
        scheme: The bilateral scheme.
    """

    SHAPES: ClassVar[dict[str, str]] = {"entry": "1", "start_tip": "3"}
    passivity: int
    period_s: float
    stiffness_n_per_m: float
    refill_damping_ns_per_mj: float
    entry: Array
    start_tip: Array
    console: ConsoleLaw
    operator: OperatorLaw
    mapping: MappingLaw
    tremor_filter: TremorFilterLaw
    roll: RollLaw
    receiver: ReceiverLaw
    has_video: int
    screen: ReceiverLaw
    tank: TankLaw
    control: PassivityLaw
    scheme: CalledScheme


class OperatorSide(Record):
    """State of the operator's side.

    Attributes:
        in_python: Whether the hand is a Python part.
        of_scheme: Whether the energy is the bilateral scheme's.
        t_s: Time [s].
        scale: Share of the force that the tank can pay for.
        roll: The instrument's roll that the grip stands for [rad].
        tip: The tip as it is known (3,) [m].
        seen: The tip as the screen shows it (3,) [m].
        wrench: What the motors are to render, force and zeros (6,) [N, N m].
        desired: Force before the tank or the passivity controller (3,) [N].
        path: Motion of the handle over the period (3,) [m].
        content: The message, twelve numbers.
        console: The console.
        mapping: Between console and world.
        tremor_filter: Of what the handle tells the remote side.
        hand: What the hand does.
        operator: The simulated operator.
        receiver: Of what comes from the remote side.
        screen: Of the picture.
        tank: The energy tank.
        port: The passivity observer.
        end: What a bilateral scheme sees and answers.
    """

    SHAPES: ClassVar[dict[str, str]] = {
        "wrench": "6",
        "content": str(CONTENT),
        **{name: "3" for name in ("tip", "seen", "desired", "path")},
    }
    in_python: int
    of_scheme: int
    t_s: float
    scale: float
    roll: float
    tip: Array
    seen: Array
    wrench: Array
    desired: Array
    path: Array
    content: Array
    console: ConsoleMemory
    mapping: Mapping
    tremor_filter: TremorFilter
    hand: HandAction
    operator: Operator
    receiver: Receiver
    screen: Receiver
    tank: Tank
    port: PortEnergy
    end: End


@compiled
def look(law: OperatorSideLaw, side: OperatorSide, line: ChannelLaw, channel: Channel, memory: Array) -> None:
    """Show the newest picture that has come by a channel of its own."""
    receive(law.screen, side.screen, line, channel, memory, side.t_s)
    known = side.screen.highest >= 0
    for i in range(3):
        side.seen[i] = side.screen.content[POSITION + i] if known else law.start_tip[i]


@compiled
def receive_at_operator(
    law: OperatorSideLaw, side: OperatorSide, line: ChannelLaw, channel: Channel, memory: Array
) -> float:
    """Take what has arrived, and find the force of the law; the energy that came with it [J]."""
    before = side.receiver.highest
    received = receive(law.receiver, side.receiver, line, channel, memory, side.t_s)
    side.end.fresh = 1 if side.receiver.highest > before else 0
    known = side.receiver.highest >= 0
    for i in range(3):
        side.tip[i] = side.receiver.content[POSITION + i] if known else law.start_tip[i]
        if not law.has_video:
            side.seen[i] = side.tip[i]
    handle = side.console.state
    feedback_force(side.mapping, handle.position, side.tip, law.stiffness_n_per_m, side.desired)
    renderable(law.console, side.console, side.desired)
    return received


@compiled
def make_passive(law: OperatorSideLaw, side: OperatorSide) -> None:
    """Force that the tank can pay for, or that the passivity controller lets through.

    With a tank below its target a damper of `refill_damping_ns_per_mj` times the shortage refills it from the
    operator's motion, as the tank-level controller of Franken et al., IEEE Trans. Robot. 27(4), 2011. What a
    damper adds is felt as far as the clutch is engaged; what it then does not burn stays to be burnt.
    """
    force, velocity, engaged = side.wrench[:3], side.console.state.velocity, side.mapping.engaged
    for i in range(3):
        force[i] = side.desired[i]
    if law.passivity == OFF:
        return
    if law.passivity == TDPA:
        impedance_control(law.control, side.port, force, velocity, law.period_s, force)
        if engaged < 1.0:
            for i in range(3):
                force[i] = side.desired[i] + engaged * (force[i] - side.desired[i])
        renderable(law.console, side.console, force)
        return
    shortage = max(law.tank.target_j - level(side.tank), 0.0)
    if shortage > 0.0:
        for i in range(3):
            force[i] -= engaged * (law.refill_damping_ns_per_mj * shortage * velocity[i])
        renderable(law.console, side.console, force)
    work = law.period_s * dot(force, velocity)
    own = 0.5 * (law.period_s * law.period_s) * dot(force, force) / law.console.least_mass_kg
    side.scale = affordable(work, own, level(side.tank) - law.tank.floor_j)
    for i in range(3):
        force[i] = side.scale * force[i]


@compiled
def _place_end(side: OperatorSide) -> None:
    """The handle as the scheme sees it: in the axes and the scale of the tip."""
    end, handle, mapping = side.end, side.console.state, side.mapping
    to_remote(mapping, handle.position, end.position)
    motion_to_remote(mapping, handle.velocity, end.velocity)
    force_to_remote(mapping, side.hand.wrench[:3], end.force)


@compiled
def _feel(law: OperatorSideLaw, gains: Array, side: OperatorSide, memory: Array, received_j: float) -> int:
    """The force of the bilateral scheme, within what the console can render."""
    end, mapping = side.end, side.mapping
    see(law.receiver, side.receiver, end, side.t_s, law.period_s, received_j)
    gain = mapping.engaged * mapping.scale
    end.mobility_per_kg = gain * gain / law.console.least_mass_kg
    _place_end(side)
    status = ask(law.scheme.feel, law.scheme, gains, end, memory)
    force_to_console(mapping, end.command, side.desired)
    renderable(law.console, side.console, side.desired)
    for i in range(3):
        side.wrench[i] = side.desired[i]
    return status


@compiled
def _tell(law: OperatorSideLaw, gains: Array, side: OperatorSide, memory: Array, rendered_j: float) -> int:
    """The message of the bilateral scheme."""
    _place_end(side)
    side.end.work_j = rendered_j
    status = ask(law.scheme.tell, law.scheme, gains, side.end, memory)
    side.content[:] = side.end.content
    return status


@compiled
def _move_console(law: OperatorSideLaw, side: OperatorSide) -> float:
    """Step the console; the work of the rendered force [J]."""
    before, handle = side.console.account.rendered_j, side.console.state
    for i in range(3):
        side.path[i] = -handle.position[i]
    step_console(law.console, side.console, side.wrench, side.hand.wrench)
    for i in range(3):
        side.path[i] += handle.position[i]
    return side.console.account.rendered_j - before


@compiled
def _settle(law: OperatorSideLaw, side: OperatorSide, rendered_j: float, received_j: float) -> float:
    """Book the tick; the energy to send [J]."""
    if law.passivity == OFF:
        return 0.0
    if law.passivity == TDPA:
        work = dot(side.desired, side.path)
        observe(side.port, work, work - rendered_j, received_j)
        return max(-work, 0.0)
    exchange(law.tank, side.tank, rendered_j, received_j)
    return send_surplus(law.tank, side.tank, law.period_s)


@compiled
def _tell_grip(law: OperatorSideLaw, side: OperatorSide) -> None:
    """Jaw and roll in the message; the roll adds up what the clutch passes on of the grip's turn."""
    handle, content = side.console.state, side.content
    rate = 0.0
    if law.roll.use:
        rate = side.mapping.engaged * rate_about(handle.rotation, 0, handle.angular_velocity)
    side.roll += law.period_s * rate
    content[JAW], content[ROLL], content[ROLL_RATE] = side.hand.jaw, side.roll, rate


@compiled
def step_operator_side(
    law: OperatorSideLaw,
    gains: Array,
    side: OperatorSide,
    line: ChannelLaw,
    channel: Channel,
    memory: Array,
) -> tuple[int, float]:
    """Receive, law, passivity, hand, console, tank: one control period from `side.t_s`.

    Args:
        law: Numbers of the side.
        gains: All numbers, among them the goals.
        side: Its state; the message to be sent is in `side.content` afterwards.
        line: Numbers of the channel from the remote side.
        channel: The channel.
        memory: All memory, among it packets and random draws.

    Returns:
        A status, and the energy to be sent [J].
    """
    remap(law.mapping, gains, side.mapping, side.t_s, side.console.state.position, side.hand.clutch)
    received = receive_at_operator(law, side, line, channel, memory)
    status = GOES_ON
    if law.passivity == SCHEME:
        status = _feel(law, gains, side, memory, received)
    else:
        make_passive(law, side)
    if status != GOES_ON:
        return status, 0.0
    if side.in_python:
        status = enter(law.entry)
    else:
        side.operator.picture = side.screen.highest if law.has_video else side.receiver.highest
        operate(
            law.operator,
            gains,
            side.operator,
            memory,
            side.t_s,
            side.seen,
            side.console.state,
            side.mapping,
            side.hand,
        )
    if status != GOES_ON:
        return status, 0.0
    rendered = _move_console(law, side)
    if law.passivity == SCHEME:
        status = _tell(law, gains, side, memory, rendered)
        _tell_grip(law, side)
        return status, side.end.energy_j
    energy = _settle(law, side, rendered, received)
    handle = side.console.state
    position, velocity = side.content[POSITION : POSITION + 3], side.content[VELOCITY : VELOCITY + 3]
    to_remote(side.mapping, handle.position, position)
    motion_to_remote(side.mapping, handle.velocity, velocity)
    steady(law.tremor_filter, side.tremor_filter, side.t_s, position, velocity)
    _tell_grip(law, side)
    return status, energy


@compiled
def fill_operator_columns(side: OperatorSide, out: Array) -> None:
    """Values of `OPERATOR_COLUMNS`, SI units by their suffix."""
    account, tank, hand, handle = side.console.account, side.tank, side.hand, side.console.state
    out[0], out[1], out[2], out[3] = level(tank), tank.overflow_j, tank.deficit_j, tank.sent_j
    out[4], out[5] = side.receiver.received_j, observed(side.port)
    out[6], out[7] = account.rendered_j, account.hand_j
    out[8], out[9], out[10] = account.kinetic_j, account.potential_j, account.motor_j
    out[11], out[12], out[13] = account.damping_j, account.friction_j, account.residual_j
    out[14] = side.scale
    for i in range(3):
        out[15 + i], out[18 + i] = handle.position[i], handle.velocity[i]
        out[21 + i], out[24 + i], out[27 + i] = side.wrench[i], hand.wrench[i], hand.intended[i]
    out[30], out[31], out[32], out[33] = hand.jaw, hand.goal, hand.missed, hand.done
    out[34], out[35], out[36] = handle.stop, side.mapping.engaged, side.mapping.scale
    if side.of_scheme:
        end = side.end
        out[0], out[1], out[2], out[5] = end.stored_j, end.burnt_j, end.deficit_j, end.observed_j
