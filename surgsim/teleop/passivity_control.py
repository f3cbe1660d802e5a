"""Time-domain passivity control of a two-port with delay: a comparison for the energy tanks."""

from pydantic import PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.tick.algebra import dot
from surgsim.tick.arrays import Array, Record


class PassivityControlConfig(PartConfig):
    """Limits of the controllers; above them a debt is carried over to the next periods.

    `damping_limit_ns_per_m` keeps the damper on the handle below what its sampled mass bears;
    `mobility_limit_m_per_ns` does the same for the velocity taken off the remote command.
    """

    damping_limit_ns_per_m: PositiveFloat = 30.0
    mobility_limit_m_per_ns: PositiveFloat = 0.05


class PassivityLaw(Record):
    """Limits, as in `PassivityControlConfig`."""

    damping_limit_ns_per_m: float
    mobility_limit_m_per_ns: float


class PortEnergy(Record):
    """Energies at one port of the channel [J].

    Attributes:
        in_j: Ever given into the channel at this port.
        out_j: Ever taken out of the channel at this port.
        received_j: What the other port gave in, as far as it is known here (delayed).
        dissipated_j: Ever burnt by this side's controller.
    """

    in_j: float
    out_j: float
    received_j: float
    dissipated_j: float


@compiled
def observed(port: PortEnergy) -> float:
    """Passivity observer W = E_in(other side, delayed) + dissipated - E_out [J]; negative is active."""
    return port.received_j + port.dissipated_j - port.out_j


@compiled
def observe(port: PortEnergy, work_j: float, dissipated_j: float, received_j: float) -> None:
    """Add one period; `work_j` is what left the channel before the controller, negative what entered."""
    port.in_j += max(-work_j, 0.0)
    port.out_j += max(work_j, 0.0)
    port.received_j += received_j
    port.dissipated_j += dissipated_j


@compiled
def _gain(port: PortEnergy, flow: Array, power_w: float, period_s: float, limit: float) -> float:
    """Smallest gain with W + T_s gain |flow|^2 >= 0 after this period, within its limit."""
    debt = max(power_w, 0.0) * period_s - observed(port)
    square = dot(flow, flow) * period_s
    if debt <= 0.0 or square <= 0.0:
        return 0.0
    return limit if debt >= limit * square else debt / square


@compiled
def impedance_control(
    law: PassivityLaw, port: PortEnergy, force: Array, velocity: Array, period_s: float, out: Array
) -> None:
    """Force on the handle with the passivity controller's damper: F - beta v.

    beta = -W / (T_s |v|^2) if the observer would turn negative, else 0.

    Args:
        law: Limits.
        port: Observer of this side.
        force: Force on the handle before the controller (3,) [N].
        velocity: Handle velocity (3,) [m/s].
        period_s: Control period T_s.
        out: Filled with the force (3,) [N]; may be `force`.

    Source:
        Hannaford, Ryu, IEEE Trans. Robot. Autom. 18(1), 2002; with delay: Ryu, Artigas, Preusche,
        Mechatronics 20(7), 2010.
    """
    beta = _gain(port, velocity, dot(force, velocity), period_s, law.damping_limit_ns_per_m)
    for i in range(3):
        out[i] = force[i] - beta * velocity[i]


@compiled
def admittance_control(
    law: PassivityLaw, port: PortEnergy, velocity: Array, force: Array, period_s: float, out: Array
) -> None:
    """Velocity command of the remote arm with the passivity controller: v - alpha f.

    alpha = -W / (T_s |f|^2) if the observer would turn negative, else 0.

    Args:
        law: Limits.
        port: Observer of this side.
        velocity: Commanded velocity before the controller (3,) [m/s].
        force: Force of the tip on its environment (3,) [N].
        period_s: Control period T_s.
        out: Filled with the velocity (3,) [m/s]; may be `velocity`.

    Source:
        As `impedance_control`.
    """
    alpha = _gain(port, force, dot(force, velocity), period_s, law.mobility_limit_m_per_ns)
    for i in range(3):
        out[i] = velocity[i] - alpha * force[i]
