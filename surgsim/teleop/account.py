"""The energy account over both tanks, both channels and both ports."""

from surgsim.columns import scalar
from surgsim.teleop.channel import Channel
from surgsim.teleop.messages import OperatorMessage, RemoteMessage
from surgsim.teleop.operator_side import OperatorSide
from surgsim.teleop.remote_side import RemoteSide

ACCOUNT_COLUMNS = (
    scalar("in_flight", "j"),
    scalar("lost", "j"),
    scalar("lost_packets"),
    scalar("delivered", "j"),
    scalar("tank_account_residual", "j"),
)


def delivered(operator: OperatorSide, remote: RemoteSide) -> float:
    """Energy that the teleoperator gave to hand and environment together [J].

    W = rendered work at the handle + work at the tip. Without stored energy a passive teleoperator keeps
    W <= 0; with tanks W <= T_o(0) + T_r(0). More is active behaviour.
    """
    return operator.console.rendered_j + remote.environment_j


def account(
    operator: OperatorSide,
    remote: RemoteSide,
    to_remote: Channel[OperatorMessage],
    to_operator: Channel[RemoteMessage],
) -> tuple[float, ...]:
    """Values of `ACCOUNT_COLUMNS`.

    Residual: T_o(0) + T_r(0) - (T_o + T_r + in flight + lost + overflow - deficit + W), zero but for
    rounding while the tanks are in use; NaN without them.
    """
    flight = to_remote.in_flight_j(remote.receiver.received_j)
    flight += to_operator.in_flight_j(operator.receiver.received_j)
    lost = to_remote.lost_j + to_operator.lost_j
    work = delivered(operator, remote)
    residual = float("nan")
    if operator.config.passivity == remote.config.passivity == "tank":
        residual = operator.config.tank.initial_j + remote.config.tank.initial_j - flight - lost - work
        for tank in (operator.tank, remote.tank):
            residual -= tank.level_j + tank.overflow_j - tank.deficit_j
    return flight, lost, float(to_remote.lost_packets + to_operator.lost_packets), work, residual
