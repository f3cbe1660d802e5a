"""A hand that follows a person's input."""

import math

import numpy as np

from surgsim.array import Array
from surgsim.teleop.console import ConsoleState
from surgsim.teleop.hand import HandCommand
from surgsim.teleop.impedance import Grip, hand_wrench
from surgsim.teleop.manual.intent import Intent, Source
from surgsim.teleop.mapping import MappingConfig, MappingLaw, describe_mapping, rotation_matrix, scale_at
from surgsim.teleop.operator import OperatorConfig
from surgsim.teleop.roll import turn_grip
from surgsim.tick.arrays import new
from surgsim.tick.overlay import take

EASE_S = 0.05
LEAD_M = 0.05
LEAD_RAD = 0.5


class LiveHand:
    """Holds the handle as the simulated operator does, but goes where `source` says, and without tremor.

        v' = (R_OW u / s - v) / EASE_S,   x' = v,   |x - x_o| <= LEAD_M

    u is the wanted velocity of the tip, x and v the hand's intended motion in console axes O. The lead is
    limited because a person at a key does not feel the force: without the limit a push against a wall would
    wind the intention up, to be undone before the tip comes back. The grip is turned about its axis in the
    same way, by at most LEAD_RAD ahead of the handle.

    Args:
        config: The hand's impedance and how fast it closes and turns the grip.
        mapping: Scale s and rotation R_WO between console and world.
        source: The person's input.
        period_s: Control period.
    """

    def __init__(
        self, config: OperatorConfig, mapping: MappingConfig, source: Source, period_s: float
    ) -> None:
        self._source, self._period, self._grip = source, period_s, new(Grip, 0)
        take(self._grip, config)
        self._R_OW, self._mapping = rotation_matrix(mapping.rotation_wxyz).T, new(MappingLaw, 0)
        describe_mapping(self._mapping, mapping, period_s)
        self._changes = mapping.change_rows().ravel()
        self._blur = 1.0 - math.exp(-period_s / EASE_S)
        self._jaw_step = period_s / config.jaw_time_s
        self._velocity = np.zeros(3)
        self._position: Array | None = None
        self._jaw = 0.0
        self._roll_speed = config.roll_speed_rad_per_s
        self._roll, self._roll_rate = 0.0, 0.0

    def step(self, t_s: float, seen_tip: Array, handle: ConsoleState) -> HandCommand:
        """What the hand does in the period from `t_s` [s]; what it sees is for the person to judge."""
        if self._position is None:
            self._position, self._upright = handle.position.copy(), handle.rotation.copy()
        intent = self._source(t_s)
        scale = scale_at(self._mapping, self._changes, t_s)
        intended = self._position = self._moved(self._position, intent, handle, scale)
        self._jaw += min(max(intent.jaw - self._jaw, -self._jaw_step), self._jaw_step)
        self._roll = self._rolled(intent, handle)
        turned, wrench = np.zeros((3, 3)), np.zeros(6)
        turn_grip(self._upright, self._roll, turned)
        hand_wrench(self._grip, intended, self._velocity, turned, handle, wrench)
        return HandCommand(
            wrench=wrench,
            jaw=self._jaw,
            goal=0,
            done=intent.end,
            missed=0,
            intended=intended,
            clutch=intent.clutch,
        )

    def _moved(self, position: Array, intent: Intent, handle: ConsoleState, scale: float) -> Array:
        wanted = self._R_OW / scale @ intent.velocity
        self._velocity = self._velocity + self._blur * (wanted - self._velocity)
        lead = position + self._period * self._velocity - handle.position
        length = math.sqrt(float(lead @ lead))
        return np.asarray(handle.position + lead * (LEAD_M / max(length, LEAD_M)))

    def _rolled(self, intent: Intent, handle: ConsoleState) -> float:
        """How far the grip shall be turned about its axis from where it was at first [rad]."""
        self._roll_rate += self._blur * (self._roll_speed * intent.roll - self._roll_rate)
        relative = self._upright.T @ handle.rotation
        turn = math.atan2(relative[2, 1] - relative[1, 2], relative[1, 1] + relative[2, 2])
        lead = math.remainder(self._roll + self._period * self._roll_rate - turn, math.tau)
        return turn + min(max(lead, -LEAD_RAD), LEAD_RAD)
