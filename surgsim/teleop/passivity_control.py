"""Time-domain passivity control of a two-port with delay: a comparison for the energy tanks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat

from surgsim.catalog import PartConfig

Array = NDArray[np.float64]


class PassivityControlConfig(PartConfig):
    """Limits of the controllers; above them a debt is carried over to the next periods.

    `damping_limit_ns_per_m` keeps the damper on the handle below what its sampled mass bears;
    `mobility_limit_m_per_ns` does the same for the velocity taken off the remote command.
    """

    damping_limit_ns_per_m: PositiveFloat = 30.0
    mobility_limit_m_per_ns: PositiveFloat = 0.05


@dataclass(frozen=True, kw_only=True, slots=True)
class PortState:
    """Energies at one port of the channel [J].

    Attributes:
        in_j: Ever given into the channel at this port.
        out_j: Ever taken out of the channel at this port.
        received_j: What the other port gave in, as far as it is known here (delayed).
        dissipated_j: Ever burnt by this side's controller.
    """

    in_j: float = 0.0
    out_j: float = 0.0
    received_j: float = 0.0
    dissipated_j: float = 0.0

    @property
    def observed_j(self) -> float:
        """Passivity observer W = E_in(other side, delayed) + dissipated - E_out; negative is active."""
        return self.received_j + self.dissipated_j - self.out_j


def observe(state: PortState, work_j: float, dissipated_j: float, received_j: float) -> PortState:
    """Add one period; `work_j` is what left the channel before the controller, negative what entered."""
    return PortState(
        in_j=state.in_j + max(-work_j, 0.0),
        out_j=state.out_j + max(work_j, 0.0),
        received_j=state.received_j + received_j,
        dissipated_j=state.dissipated_j + dissipated_j,
    )


def _gain(state: PortState, flow: Array, power_w: float, period_s: float, limit: float) -> float:
    """Smallest gain with W + T_s gain |flow|^2 >= 0 after this period, within its limit."""
    debt = max(power_w, 0.0) * period_s - state.observed_j
    square = float(flow @ flow) * period_s
    if debt <= 0.0 or square <= 0.0:
        return 0.0
    return limit if debt >= limit * square else debt / square


def impedance_control(
    state: PortState, force: Array, velocity: Array, period_s: float, config: PassivityControlConfig
) -> Array:
    """Force on the handle with the passivity controller's damper: F - beta v.

    beta = -W / (T_s |v|^2) if the observer would turn negative, else 0.

    Args:
        state: Observer of this side.
        force: Force on the handle before the controller (3,) [N].
        velocity: Handle velocity (3,) [m/s].
        period_s: Control period T_s.
        config: Limits.

    Source:
        Hannaford, Ryu, IEEE Trans. Robot. Autom. 18(1), 2002; with delay: Ryu, Artigas, Preusche,
        Mechatronics 20(7), 2010.
    """
    power = float(force @ velocity)
    return force - _gain(state, velocity, power, period_s, config.damping_limit_ns_per_m) * velocity


def admittance_control(
    state: PortState, velocity: Array, force: Array, period_s: float, config: PassivityControlConfig
) -> Array:
    """Velocity command of the remote arm with the passivity controller: v - alpha f.

    alpha = -W / (T_s |f|^2) if the observer would turn negative, else 0.

    Args:
        state: Observer of this side.
        velocity: Commanded velocity before the controller (3,) [m/s].
        force: Force of the tip on its environment (3,) [N].
        period_s: Control period T_s.
        config: Limits.

    Source:
        As `impedance_control`.
    """
    power = float(force @ velocity)
    return velocity - _gain(state, force, power, period_s, config.mobility_limit_m_per_ns) * force
