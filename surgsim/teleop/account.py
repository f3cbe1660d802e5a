"""The energy account over both tanks, both channels and both ports."""

import math

from surgsim.array import Array
from surgsim.columns import scalar
from surgsim.compiled import compiled
from surgsim.teleop.channel import Channel, in_flight
from surgsim.teleop.messages import TANK
from surgsim.teleop.operator_side import OperatorSide, OperatorSideLaw
from surgsim.teleop.remote_side import RemoteSide, RemoteSideLaw
from surgsim.teleop.tank import Tank, level

ACCOUNT_COLUMNS = (
    scalar("in_flight", "j"),
    scalar("lost", "j"),
    scalar("lost_packets"),
    scalar("delivered", "j"),
    scalar("tank_account_residual", "j"),
)


@compiled
def _booked(tank: Tank) -> float:
    """What a tank holds and has given up, less what it owes [J]."""
    return level(tank) + tank.overflow_j - tank.deficit_j


@compiled
def fill_account(
    operator_law: OperatorSideLaw,
    operator: OperatorSide,
    remote_law: RemoteSideLaw,
    remote: RemoteSide,
    forth: Channel,
    back: Channel,
    out: Array,
) -> None:
    """Values of `ACCOUNT_COLUMNS`.

    Delivered W, what the teleoperator gave to hand and environment together: rendered work at the handle and
    work at the tip. Without stored energy a passive teleoperator keeps W <= 0; with tanks
    W <= T_o(0) + T_r(0). More is active behaviour.

    Residual: T_o(0) + T_r(0) - (T_o + T_r + in flight + lost + overflow - deficit + W), zero but for
    rounding while the tanks are in use; NaN without them.
    """
    flight = in_flight(forth, remote.receiver.received_j) + in_flight(back, operator.receiver.received_j)
    lost = forth.lost_j + back.lost_j
    work = operator.console.account.rendered_j + remote.environment_j
    residual = math.nan
    if operator_law.passivity == TANK and remote_law.passivity == TANK:
        residual = operator_law.tank.initial_j + remote_law.tank.initial_j - flight - lost - work
        residual -= _booked(operator.tank)
        residual -= _booked(remote.tank)
    out[0], out[1], out[2] = flight, lost, forth.lost_packets + back.lost_packets
    out[3], out[4] = work, residual
