"""The operator's side: console, hand, force law, tank or passivity controller."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import NonNegativeFloat

from surgsim.catalog import PartConfig
from surgsim.columns import scalar, vector
from surgsim.teleop import passivity_control
from surgsim.teleop import tank as tanks
from surgsim.teleop.channel import EnergyMode, Packet
from surgsim.teleop.console import Console, ConsoleConfig
from surgsim.teleop.mapping import Mapping, MappingConfig, feedback_force
from surgsim.teleop.messages import OperatorMessage, PassivityMode, RemoteMessage
from surgsim.teleop.operator import Goal, Hand, HandCommand, Operator, OperatorConfig
from surgsim.teleop.receiver import Receiver, ReceiverConfig

Array = NDArray[np.float64]
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
)


class OperatorSideConfig(PartConfig):
    """The operator's side.

    `stiffness_n_per_m` is K_v of the force law, per metre of handle motion. With a tank below its target a
    damper of `refill_damping_ns_per_mj` times the shortage refills it from the operator's motion, as the
    tank-level controller of Franken et al., IEEE Trans. Robot. 27(4), 2011; 0 turns that off.
    """

    stiffness_n_per_m: NonNegativeFloat = 60.0
    refill_damping_ns_per_mj: NonNegativeFloat = 20.0
    passivity: PassivityMode = "tank"
    mapping: MappingConfig = MappingConfig()
    console: ConsoleConfig = ConsoleConfig()
    operator: OperatorConfig = OperatorConfig()
    receiver: ReceiverConfig = ReceiverConfig()
    tank: tanks.TankConfig = tanks.TankConfig()
    control: passivity_control.PassivityControlConfig = passivity_control.PassivityControlConfig()


@dataclass(frozen=True, kw_only=True, slots=True)
class OperatorOutput:
    """What one tick sends: the message and the energy that goes with it, and what the hand did."""

    message: OperatorMessage
    energy_j: float
    hand: HandCommand


class OperatorSide:
    """One tick: receive, law, passivity, hand, console, tank, send."""

    def __init__(
        self,
        config: OperatorSideConfig,
        goals: tuple[Goal, ...],
        start_tip: ArrayLike,
        energy: EnergyMode,
        seed: np.random.SeedSequence,
        hand: Hand | None = None,
        period_s: float = 0.001,
    ) -> None:
        """Put console and tip in correspondence; `hand` takes the simulated operator's place."""
        self.config = config
        self.console = Console(config.console, period_s)
        self.period_s = period_s
        self._state = self.console.state()
        self._start_tip = np.array(start_tip, dtype=float)
        self.mapping = Mapping.aligned(config.mapping, self._state.position, self._start_tip)
        self.holder: Hand = hand or Operator(config.operator, goals, self.mapping, self.period_s, seed)
        self.receiver: Receiver[RemoteMessage] = Receiver(config.receiver, energy)
        self.tank = tanks.start(config.tank)
        self.port = passivity_control.PortState()
        self._force, self._scale = np.zeros(3), 1.0
        self._hand: HandCommand | None = None

    def step(self, t_s: float, packets: Iterable[Packet[RemoteMessage]]) -> OperatorOutput:
        """Advance from `t_s` by one control period, with the packets that have arrived by `t_s`."""
        received = self.receiver.accept(t_s, packets)
        newest = self.receiver.newest
        tip = self._start_tip if newest is None else newest.content.position
        spring = feedback_force(self.mapping, self._state.position, tip, self.config.stiffness_n_per_m)
        desired = self.console.renderable(spring)
        self._force = self._passive(desired)
        self._hand = self.holder.step(t_s, tip, self._state)
        rendered = self._move_console(self._hand)
        energy = self._settle(desired, rendered, received)
        state = self._state
        message = OperatorMessage(
            position=self.mapping.to_remote(state.position),
            velocity=self.mapping.motion_to_remote(state.velocity),
            jaw=self._hand.jaw,
        )
        return OperatorOutput(message=message, energy_j=energy, hand=self._hand)

    def signals(self) -> tuple[float, ...]:
        """Values of `OPERATOR_COLUMNS` after the last step, SI units by their suffix."""
        account, level, state, hand = self.console.energy(), self.tank, self._state, self._hand
        return (
            level.level_j,
            level.overflow_j,
            level.deficit_j,
            level.sent_j,
            self.receiver.received_j,
            self.port.observed_j,
            account.rendered_j,
            account.hand_j,
            account.kinetic_j,
            account.potential_j,
            account.motor_j,
            account.damping_j,
            account.friction_j,
            account.residual_j,
            self._scale,
            *state.position.tolist(),
            *state.velocity.tolist(),
            *self._force.tolist(),
            *(hand.wrench[:3].tolist() if hand else (math.nan,) * 3),
            *(hand.intended.tolist() if hand else (math.nan,) * 3),
            hand.jaw if hand else 0.0,
            float(hand.goal) if hand else 0.0,
            float(hand.missed) if hand else 0.0,
            float(hand.done) if hand else 0.0,
        )

    def _passive(self, force: Array) -> Array:
        """Force that the tank can pay for, or that the passivity controller lets through."""
        config, velocity = self.config, self._state.velocity
        if config.passivity == "off":
            return force
        if config.passivity == "tdpa":
            damped = passivity_control.impedance_control(
                self.port, force, velocity, self.period_s, config.control
            )
            return self.console.renderable(damped)
        shortage = max(config.tank.target_j - self.tank.level_j, 0.0)
        braked = force
        if shortage > 0.0:
            brake = config.refill_damping_ns_per_mj * shortage * velocity
            braked = self.console.renderable(force - brake)
        work = self.period_s * float(braked @ velocity)
        own = 0.5 * self.period_s**2 * float(braked @ braked) / config.console.least_mass_kg
        self._scale = tanks.affordable(work, own, self.tank.level_j - config.tank.floor_j)
        return self._scale * braked

    def _move_console(self, hand: HandCommand) -> float:
        """Step the console; returns the work of the rendered force [J]."""
        before = self.console.rendered_j
        wrench = np.zeros(6)
        wrench[:3] = self._force
        self._path = self._state.position
        self._state = self.console.step(wrench, hand.wrench)
        self._path = self._state.position - self._path
        return self.console.rendered_j - before

    def _settle(self, desired: Array, rendered_j: float, received_j: float) -> float:
        """Book the tick; returns the energy to send [J]."""
        config = self.config
        if config.passivity == "off":
            return 0.0
        if config.passivity == "tdpa":
            work = float(desired @ self._path)
            self.port = passivity_control.observe(self.port, work, work - rendered_j, received_j)
            return max(-work, 0.0)
        self.tank = tanks.exchange(self.tank, config.tank, rendered_j, received_j)
        self.tank, energy = tanks.send_surplus(self.tank, config.tank, self.period_s)
        return energy
