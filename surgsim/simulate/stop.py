"""The controlled stop: brakes the arm and holds it where it came to rest.

IEC 60204-1 knows three stops: category 0 takes the power away, category 1 brakes and then takes it away,
category 2 brakes and holds under power. This is category 2: an arm without brakes that loses its torque
falls, and its instrument is in a patient.
"""

import math
from typing import ClassVar

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.arm import ArmModel
from surgsim.scenario.schema import StopConfig
from surgsim.tick.algebra import times
from surgsim.tick.arrays import Model, Record, World, new
from surgsim.tick.nominal import dynamics, kinematics
from surgsim.tick.scratch import scratch

_LEAST_TORQUE_NM = 1.0
DRIVE_SHARE = 0.06
"""Most that w may be of the lowest frequency of the drives: the stop knows nothing of their gears."""


class Stop(Record):
    """A stop: its law's numbers, its memory, and the motion that it asks for.

    Attributes:
        stiffness: w^2 [1/s^2].
        share: Of the torque limits that may brake.
        begun: Whether it has begun.
        begun_s: When [s].
        length_s: How long it takes [s].
        q_begun: Joint positions then (n,) [rad].
        v_begun: Joint velocities then (n,) [rad/s].
        q: Joint positions asked for (n,) [rad].
        qdot: Joint velocities asked for (n,) [rad/s].
        torque: (n,) [N m].
        q_min: Joint range (n,) [rad].
        q_max: Joint range (n,) [rad].
        tau_max: Torque limits (n,) [N m].
        nominal: The nominal model.
    """

    SHAPES: ClassVar[dict[str, str]] = {
        name: "n" for name in ("q_begun", "v_begun", "q", "qdot", "torque", "q_min", "q_max", "tau_max")
    }
    stiffness: float
    share: float
    begun: int
    begun_s: float
    length_s: float
    q_begun: Array
    v_begun: Array
    q: Array
    qdot: Array
    torque: Array
    q_min: Array
    q_max: Array
    tau_max: Array
    nominal: Model


def new_stop(config: StopConfig, arm: ArmModel) -> Stop:
    """A stop that has not begun; `arm` must outlive it."""
    limits = arm.limits
    stop = new(Stop, limits.q_min.size)
    softest = (DRIVE_SHARE * arm.locked_frequency) ** 2
    stop.stiffness, stop.share = min(config.stiffness_per_s2, softest), config.torque_share
    stop.q_min[:], stop.q_max[:], stop.tau_max[:] = limits.q_min, limits.q_max, limits.torque
    arm.point(stop.nominal)
    return stop


@compiled
def brake(stop: Stop, world: World) -> None:
    """Joint impedance about a motion that comes to rest with limited deceleration.

        tau = M(q) (q_s'' + 2 w (q_s' - q') + w^2 (q_s - q)) + bias(q, q'),  w^2 = stiffness

    from the measured state and the nominal model alone. The stopping motion goes on along the joint velocity
    of its first tick, all joints in step: q_s' falls linearly to zero within T = max_i |M q'|_i / (share
    (t_i - |bias_i|)), with the torque limits t; a joint that comes to its position limit stays there.

    The first call after `stop.begun` is zero begins the stop.
    """
    n, M, bias = world.q_m.size, stop.nominal.M, stop.nominal.bias
    kinematics(stop.nominal, world.q_m)
    dynamics(stop.nominal, world.v_m)
    wanted = scratch(n)
    if not stop.begun:
        times(M, world.v_m, wanted)
        length = 1e-9
        for i in range(n):
            free = max(stop.tau_max[i] - abs(bias[i]), _LEAST_TORQUE_NM)
            length = max(length, abs(wanted[i]) / (stop.share * free))
            stop.q_begun[i], stop.v_begun[i] = world.q_m[i], world.v_m[i]
        stop.begun, stop.begun_s, stop.length_s = 1, world.t_s, length
    length = stop.length_s
    left = 1.0 - min(world.t_s - stop.begun_s, length) / length
    w = math.sqrt(stop.stiffness)
    for i in range(n):
        free = stop.q_begun[i] + stop.v_begun[i] * (0.5 * length * (1.0 - left * left))
        stop.q[i] = min(max(free, stop.q_min[i]), stop.q_max[i])
        moving = stop.v_begun[i] if stop.q[i] == free else 0.0
        stop.qdot[i] = moving * left
        a = -moving / length if left > 0.0 else 0.0
        wanted[i] = a + 2.0 * w * (stop.qdot[i] - world.v_m[i]) + w * w * (stop.q[i] - world.q_m[i])
    times(M, wanted, stop.torque)
    for i in range(n):
        stop.torque[i] += bias[i]
