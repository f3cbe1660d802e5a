"""The remote side: set points for the arm, its energy budget, tank or passivity controller."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.columns import scalar, vector
from surgsim.teleop import passivity_control
from surgsim.teleop import tank as tanks
from surgsim.teleop.channel import EnergyMode, Packet
from surgsim.teleop.messages import OperatorMessage, PassivityMode, RemoteMessage
from surgsim.teleop.receiver import Receiver, ReceiverConfig

Array = NDArray[np.float64]
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
)


class RemoteSideConfig(PartConfig):
    """The remote side.

    v_d = trust (v + drift_gain (x - x_r)), with the master's velocity v and position x as received: the
    second term keeps lost packets from adding up to an offset, and is cut at `drift_speed_m_per_s`. With
    drift_gain 0 the command is the paper's pure velocity.
    """

    drift_gain_per_s: NonNegativeFloat = 2.0
    drift_speed_m_per_s: PositiveFloat = 0.02
    passivity: PassivityMode = "tank"
    receiver: ReceiverConfig = ReceiverConfig()
    tank: tanks.TankConfig = tanks.TankConfig()
    control: passivity_control.PassivityControlConfig = passivity_control.PassivityControlConfig()


@dataclass(frozen=True, kw_only=True, slots=True)
class RemoteMeasurement:
    """What the remote arm measured over the last control period.

    Attributes:
        position: Tip position now (3,) [m].
        force: Force of the tip on its environment now (3,) [N].
        work_j: Energy that the tip gave to its environment in the last period; negative if it absorbed some.
    """

    position: Array
    force: Array
    work_j: float


@dataclass(frozen=True, kw_only=True, slots=True)
class RemoteOutput:
    """What one tick commands and sends.

    Attributes:
        velocity: Desired tip velocity v_d (3,) [m/s].
        jaw: Closing of the jaws, 0 to 1.
        budget_j: Right side of the passivity row, T - epsilon [J]; infinite without a tank.
        message: For the operator's side.
        energy_j: Energy to send with it [J].
    """

    velocity: Array
    jaw: float
    budget_j: float
    message: RemoteMessage
    energy_j: float


class RemoteSide:
    """One tick: receive, book the environment's work, set point, send."""

    def __init__(
        self, config: RemoteSideConfig, start_tip: ArrayLike, energy: EnergyMode, period_s: float
    ) -> None:
        self.config = config
        self.period_s = period_s
        self._start_tip = np.array(start_tip, dtype=float)
        self.receiver: Receiver[OperatorMessage] = Receiver(config.receiver, energy)
        self.tank = tanks.start(config.tank)
        self.port = passivity_control.PortState()
        self.environment_j = 0.0
        self._wanted, self._velocity = np.zeros(3), np.zeros(3)
        self._jaw, self._trust = 0.0, 0.0

    def step(
        self, t_s: float, packets: Iterable[Packet[OperatorMessage]], measured: RemoteMeasurement
    ) -> RemoteOutput:
        """Command for the period from `t_s`, with the packets that have arrived by `t_s`."""
        received = self.receiver.accept(t_s, packets)
        self.environment_j += measured.work_j
        energy = self._settle(measured, received)
        self._wanted = self._set_point(t_s, measured)
        self._velocity = self._passive(self._wanted, measured.force)
        return RemoteOutput(
            velocity=self._velocity,
            jaw=self._jaw,
            budget_j=self._budget(),
            message=RemoteMessage(position=measured.position, force=measured.force),
            energy_j=energy,
        )

    def signals(self) -> tuple[float, ...]:
        """Values of `REMOTE_COLUMNS` after the last step, SI units by their suffix."""
        level = self.tank
        return (
            level.level_j,
            level.overflow_j,
            level.deficit_j,
            level.sent_j,
            self.receiver.received_j,
            self.port.observed_j,
            self._budget(),
            self.environment_j,
            self._trust,
            float(self.receiver.late_packets),
            float(self.receiver.duplicate_packets),
            *self._velocity.tolist(),
            self._jaw,
        )

    def _set_point(self, t_s: float, measured: RemoteMeasurement) -> Array:
        newest, self._trust = self.receiver.newest, self.receiver.trust(t_s)
        if newest is None:
            return np.zeros(3)
        order = newest.content
        self._jaw = order.jaw
        drift = self.config.drift_gain_per_s * (order.position - measured.position)
        speed, limit = math.sqrt(float(drift @ drift)), self.config.drift_speed_m_per_s
        if speed > limit:
            drift = drift * (limit / speed)
        return np.asarray(self._trust * (order.velocity + drift))

    def _passive(self, velocity: Array, force: Array) -> Array:
        if self.config.passivity != "tdpa":
            return velocity
        return passivity_control.admittance_control(
            self.port, velocity, force, self.period_s, self.config.control
        )

    def _budget(self) -> float:
        return tanks.budget(self.tank, self.config.tank) if self.config.passivity == "tank" else math.inf

    def _settle(self, measured: RemoteMeasurement, received_j: float) -> float:
        """Book the last period; returns the energy to send [J]."""
        if self.config.passivity == "off":
            return 0.0
        if self.config.passivity == "tdpa":
            work = self.period_s * float(measured.force @ self._wanted)
            burnt = work - self.period_s * float(measured.force @ self._velocity)
            self.port = passivity_control.observe(self.port, work, burnt, received_j)
            return max(-work, 0.0)
        self.tank = tanks.exchange(self.tank, self.config.tank, measured.work_j, received_j)
        self.tank, energy = tanks.send_surplus(self.tank, self.config.tank, self.period_s)
        return energy
