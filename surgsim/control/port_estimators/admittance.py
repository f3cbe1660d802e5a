"""Admittance of the remote centre: it gives way to the lateral force on the shaft as a mass would."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig, Surroundings
from surgsim.compiled import compiled
from surgsim.control.admittance import give_way, heed
from surgsim.control.filters import filter_gains
from surgsim.control.observer import observe_positions, position_observer_size
from surgsim.control.port_estimators.base import KernelPortEstimator
from surgsim.control.port_force import lateral_force, split_wrench
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Seen
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON, RANK_LOST

MASS, DAMPING, STIFFNESS, DEAD_ZONE, TARE_S, MOST, SENSOR, OTHER, OBSERVER, STATE = range(10)
"""Places of the gains."""


class PortAdmittanceConfig(PartConfig):
    """Lets the remote centre give way to the lateral force of the wall as a mass with damping does.

    Attributes:
        mass_kg: M_a of the admittance [kg].
        damping_n_s_per_m: D_a [N s/m].
        stiffness_n_per_m: K_a, that pulls the remote centre back to the trocar as seen [N/m].
        dead_zone_n: Forces below this move nothing [N].
        force: What the force is taken from: `joints`, the disturbance torque that an observer infers, or
            `flange`, the force-torque sensor there.
        other_contact: With `flange`, where the shaft is touched beside the port: at the `tip`, or by a `hand`
            on the shaft's upper end. The forces of the two are told apart by their moments.
        hand_from_tip_m: Distance of that hand from the shaft's end [m].
        tare_s: The mean force over this first time is taken off; the shaft must hang free so long [s].
        most_m: Farthest that the remote centre may go from the trocar as seen [m].
        observer_hz: With `joints`, cut-off of the force estimate [Hz].
        state_hz: With `joints`, cut-off of the positions and velocities that it is made of [Hz].
    """

    type: Literal["admittance"] = "admittance"
    mass_kg: PositiveFloat = 2.0
    damping_n_s_per_m: PositiveFloat = 70.0
    stiffness_n_per_m: NonNegativeFloat = 0.0
    dead_zone_n: NonNegativeFloat = 0.1
    force: Literal["joints", "flange"] = "flange"
    other_contact: Literal["tip", "hand"] = "tip"
    hand_from_tip_m: Annotated[float, Field(gt=0.0, le=1.0)] = 0.4
    tare_s: NonNegativeFloat = 0.2
    most_m: PositiveFloat = 0.03
    observer_hz: PositiveFloat = 5.0
    state_hz: PositiveFloat = 20.0

    def check(self, scenario: Surroundings) -> None:
        """Refuse a scenario without a wall, or without the sensor that is to feel it."""
        if not scenario.has_wall:
            raise ValueError("controller.port 'admittance' feels no wall: give trocar.wall")
        if self.force == "flange" and not scenario.has_force_sensor:
            raise ValueError(
                "controller.port 'admittance' needs the disturbance force_torque_sensor, or force: joints"
            )

    def build(self, arm: ArmModel) -> KernelPortEstimator:
        """The estimator; memory tare (3,), offset (3,) and its rate (3,), ticks, the observer's."""
        flange = self.force == "flange"
        gains = [
            self.mass_kg,
            self.damping_n_s_per_m,
            self.stiffness_n_per_m,
            self.dead_zone_n,
            self.tare_s,
            self.most_m,
            float(flange),
            self.hand_from_tip_m if self.other_contact == "hand" else 0.0,
            self.observer_hz,
            self.state_hz,
        ]
        return KernelPortEstimator(
            kernel=port_admittance,
            arm=arm,
            gains=np.array(gains, dtype=np.float64),
            memory_size=10 + (0 if flange else position_observer_size(arm.limits.torque.size)),
        )


@compiled
def port_admittance(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """The remote centre moves as a body that the wall's lateral force F pushes.

        M_a o'' + D_a o' + K_a o = dead(F - tare),   p_C = p_seen + o

    dead(F) = F (1 - F_0/|F|), 0 below F_0 (`surgsim.control.admittance`).

    With a wall of stiffness K and a shaft that follows, o settles where the wall is relaxed, as a system of
    second order with the natural frequency sqrt((K + K_a)/M_a).

    Source: the target admittance of Nasiri and Wang (arXiv 2404.04416, 2407.12711), which estimates the force
    at the port and lets the constraint give way to it inside the redundancy resolution; its equations and
    gains were not seen, the form is the common one. The two forces from one wrench: `split_wrench`.
    """
    dt = seen.dt_s
    tare, offset, rate = memory[:3], memory[3:6], memory[6:9]
    force, other = scratch(3), scratch(3)
    for i in range(3):
        force[i] = 0.0
    if gains[SENSOR] != 0.0:
        if seen.has_wrench:
            split_wrench(seen, gains[OTHER], force, other)
    else:
        cut = filter_gains(gains[STATE], gains[OBSERVER], dt)
        d = observe_positions(
            memory[10:], seen.first != 0, seen.M, seen.bias, seen.damping, seen.q, seen.tau, cut, dt
        )
        if not lateral_force(seen, d, force):
            return RANK_LOST
    memory[9] += 1.0
    heed(force, tare, memory[9], seen.t_s < gains[TARE_S], gains[DEAD_ZONE])
    give_way(force, gains[MASS], gains[DAMPING], gains[STIFFNESS], gains[MOST], dt, offset, rate)
    for i in range(3):
        out[0, i] = seen.p_WC[i] + offset[i]
        out[1, i] = seen.v_WC[i] + rate[i]
        out[2, i] = 0.0
    return GOES_ON
