"""Time-domain passivity control of a two-port with delay: a comparison for the energy tanks.

The time-delay power network is all that lies between two ports: that of the handle, with the rendered force
and the handle's velocity, and that of the remote command, with the force of the tip and the commanded
velocity. What enters at one port may leave at the other, later:

    E_out(k) <= E_in(k - D)    at both.

Sources: Hannaford, Ryu, IEEE Trans. Robot. Autom. 18(1), 2002; with delay: Ryu, Artigas, Preusche,
Mechatronics 20(7), 2010; compensation of drift: arXiv 1909.01603.
"""

from typing import Literal

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.tick.algebra import dot, norm
from surgsim.tick.arrays import Record


class PassivityControlConfig(PartConfig):
    """The force at the remote port, and the limits of the controllers.

    `port_force` is the `measured` force of the tip on its environment, or the `coordinating` force of the
    arm's controller. The latter presumes that arm and controller take energy from the command alone, which
    a law with feedforward does not. Its coupling is that of the arm's own tip law on 2.7 kg, 1e4 per square
    second, led by 1 mm.

    Above a limit a debt is carried over to the next periods. `damping_limit_ns_per_m` keeps the damper on the
    handle below what its sampled mass bears; `mobility_limit_m_per_ns` does the same for the velocity taken
    off the remote command, whose force follows with `coupling_stiffness_n_per_m` T_s a tick.
    """

    port_force: Literal["measured", "coordinating"] = "measured"
    damping_limit_ns_per_m: PositiveFloat = 30.0
    mobility_limit_m_per_ns: PositiveFloat = 0.01
    coupling_stiffness_n_per_m: PositiveFloat = 27000.0
    coupling_damping_ns_per_m: NonNegativeFloat = 20.0
    coupling_lead_m: PositiveFloat = 0.001


class PassivityLaw(Record):
    """Limits and coupling, as in `PassivityControlConfig`.

    Attributes:
        coordinates: Whether the force at the remote port is the coordinating force.
        damping_limit_ns_per_m: Of the damper on the handle.
        mobility_limit_m_per_ns: Of the velocity taken off the remote command.
        coupling_stiffness_n_per_m: K of the coordinating force.
        coupling_damping_ns_per_m: B of it.
        coupling_lead_m: How far the integrated command may lead the tip.
    """

    coordinates: int
    damping_limit_ns_per_m: float
    mobility_limit_m_per_ns: float
    coupling_stiffness_n_per_m: float
    coupling_damping_ns_per_m: float
    coupling_lead_m: float


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
        force: Force at the remote port (3,) [N].
        period_s: Control period T_s.
        out: Filled with the velocity (3,) [m/s]; may be `velocity`.
    """
    alpha = _gain(port, force, dot(force, velocity), period_s, law.mobility_limit_m_per_ns)
    for i in range(3):
        out[i] = velocity[i] - alpha * force[i]


@compiled
def keep_lead(law: PassivityLaw, reference: Array, position: Array) -> None:
    """Draw `reference` (3,) [m], the integrated command, up to its lead of the tip at `position` (3,) [m]."""
    lead = np.empty(3)
    for i in range(3):
        lead[i] = reference[i] - position[i]
    kept = law.coupling_lead_m / max(norm(lead), law.coupling_lead_m)
    for i in range(3):
        reference[i] = position[i] + kept * lead[i]


@compiled
def coordinating_force(
    law: PassivityLaw, reference: Array, position: Array, commanded: Array, velocity: Array, out: Array
) -> None:
    """Force with which the arm's controller drives the tip, F = K (x_d - x) + B (v_d - v).

    Args:
        law: K and B.
        reference: x_d, the integrated command (3,) [m].
        position: Tip position x (3,) [m].
        commanded: v_d, the last commanded velocity (3,) [m/s].
        velocity: Tip velocity v (3,) [m/s].
        out: Filled with the force (3,) [N].
    """
    for i in range(3):
        out[i] = law.coupling_stiffness_n_per_m * (reference[i] - position[i])
        out[i] += law.coupling_damping_ns_per_m * (commanded[i] - velocity[i])


@compiled
def compensate_drift(
    port: PortEnergy, pull: Array, force: Array, period_s: float, most_m_per_s: float, velocity: Array
) -> None:
    """Add to `velocity` (3,) [m/s] a pull against drift, as far as the received energy pays for it.

        v += c pull,   T_s c pull . F <= E_in(k - D) - E_out(k) - T_s max(F . v, 0),   |c pull| <= v_max

    c is the largest in [0, 1] that does. A pull that the force F (3,) [N] helps costs nothing.

    Args:
        port: Observer of this side.
        pull: The pull (3,) [m/s].
        force: F (3,) [N].
        period_s: T_s [s].
        most_m_per_s: v_max [m/s].
        velocity: v before and after (3,) [m/s].
    """
    speed = norm(pull)
    share = min(1.0, most_m_per_s / max(speed, most_m_per_s))
    cost = period_s * share * dot(force, pull)
    left = max(observed(port) - period_s * max(dot(force, velocity), 0.0), 0.0)
    if cost > left:
        share = share * left / cost
    for i in range(3):
        velocity[i] += share * pull[i]
