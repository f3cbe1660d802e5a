"""Sliding mode: RCM over tip over posture, each driven onto a surface, with a boundary layer around it."""

from typing import Literal

import numpy as np
from pydantic import PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.control.torque_laws.base import KernelTorqueLaw
from surgsim.control.torque_laws.decoupled import decouple
from surgsim.control.torque_laws.rcm_hierarchy import fill_task_errors
from surgsim.control.torque_laws.rcm_tasks import fill_bias
from surgsim.models.arm import ArmModel
from surgsim.tick.arrays import Seen
from surgsim.tick.nominal import copy_model
from surgsim.tick.scratch import scratch, scratch_matrix
from surgsim.tick.status import GOES_ON, RANK_LOST

RCM_GAINS, TIP_GAINS, JOINT_GAINS = 0, 3, 6
"""Where the slope, reach and layer of a task begin among the gains."""
INTEGRAL = 9
"""Place of the gain that is 1 where the surface has an integral."""
ROWS = 5
"""Rows of the tasks; the memory has the integral of each one's error (ROWS,) [m s], tip first."""
RCM, TIP, JOINT, BIAS = range(4)
"""Rows of the terms."""


class RcmSlidingModeConfig(PartConfig):
    """Sliding surfaces of RCM, tip and posture, an equivalent control and a saturated reaching law.

    Attributes:
        surface: `pd`, s = e' + l e, or `pid`, s = e' + 2 l e + l^2 times the integral of e.
        rcm_slope_per_s: l of the RCM [1/s].
        rcm_reach_m_per_s2: k of the RCM, the largest acceleration that counters a disturbance [m/s^2].
        rcm_layer_m_per_s: f of the RCM, half the thickness of its boundary layer [m/s].
        tip_slope_per_s: l of the tip [1/s].
        tip_reach_m_per_s2: k of the tip [m/s^2].
        tip_layer_m_per_s: f of the tip [m/s].
        joint_slope_per_s: l of the posture, whose surface is `pd` [1/s].
        joint_reach_rad_per_s2: k of the posture [rad/s^2].
        joint_layer_rad_per_s: f of the posture [rad/s].
        drive_slope_share: On elastic drives each slope is at most this share of the lowest sqrt(K / B_s).
        drive_layer_share: On them each layer is so thick that k/f is at most this share of it.
    """

    type: Literal["rcm_sliding_mode"] = "rcm_sliding_mode"
    surface: Literal["pd", "pid"] = "pid"
    rcm_slope_per_s: PositiveFloat = 60.0
    rcm_reach_m_per_s2: PositiveFloat = 6.0
    rcm_layer_m_per_s: PositiveFloat = 0.05
    tip_slope_per_s: PositiveFloat = 60.0
    tip_reach_m_per_s2: PositiveFloat = 6.0
    tip_layer_m_per_s: PositiveFloat = 0.05
    joint_slope_per_s: PositiveFloat = 10.0
    joint_reach_rad_per_s2: PositiveFloat = 5.0
    joint_layer_rad_per_s: PositiveFloat = 0.5
    drive_slope_share: PositiveFloat = 0.12
    drive_layer_share: PositiveFloat = 0.12

    def build(self, arm: ArmModel) -> KernelTorqueLaw:
        """The law; its memory is the integrals of the errors."""
        numbers = (
            (self.rcm_slope_per_s, self.rcm_reach_m_per_s2, self.rcm_layer_m_per_s),
            (self.tip_slope_per_s, self.tip_reach_m_per_s2, self.tip_layer_m_per_s),
            (self.joint_slope_per_s, self.joint_reach_rad_per_s2, self.joint_layer_rad_per_s),
        )
        steepest = self.drive_slope_share * arm.locked_frequency
        fastest = self.drive_layer_share * arm.locked_frequency
        gains = [x for slope, k, f in numbers for x in (min(slope, steepest), k, max(f, k / fastest))]
        return KernelTorqueLaw(
            kernel=rcm_sliding_mode,
            arm=arm,
            terms=("rcm", "tip", "joint", "bias"),
            gains=np.array([*gains, float(self.surface == "pid")]),
            memory_size=ROWS,
        )


@compiled
def rcm_sliding_mode(gains: Array, seen: Seen, memory: Array, out: Array) -> int:
    """Tau = J_r' F_r + N_1 J_t' F_t + N_2 M q''_0 + h; rows rcm, tip, joint, bias (4, n) [N m].

    Each row e of the errors of RCM and tip, with e'' = J q'' + b, is asked for

        J q'' = -b - l e' - k sat(s/f),               s = e' + l e                           (pd)
        J q'' = -b - 2 l e' - l^2 e - k sat(s/f),     s = e' + 2 l e + l^2 (integral of e)   (pid)

    so that s' = -k sat(s/f) + w with w the disturbance's acceleration; the posture likewise, by `pd` about
    the joint reference. sat(x) is x cut at -1 and 1. While |w| < k the layer |s| < f is reached in at most
    (|s| - f) / (k - |w|), and kept. In it, with `pd`, |e| comes to f/l at most. A constant w leaves
    e = w f/(k l) with `pd` and none with `pid`. The integral waits outside the layer, or it would wind up.

    F_r, F_t and the projectors are those of `surgsim.control.torque_laws.decoupled.decouple`, and h the bias
    and joint damping of the nominal model.

    Source: surface, equivalent control and boundary layer are those of Slotine and Sastry, Int. J. Control
    38:465 (1983), and Slotine and Li, Applied Nonlinear Control (1991), chapter 7, which has the integral
    surface too: recalled, and the layer read at second hand. Ours: rows of RCM and tip as the surfaces'
    errors, and that the integral waits. No published sliding-mode law for an RCM was found.
    """
    n, m, model = seen.q.size, 3 + seen.rows, seen.elsewhere
    copy_model(seen, model)
    J, a, posture = scratch_matrix(m, n), scratch(m), scratch(n)
    error, rate, bias = scratch(m), scratch(m), scratch(m)
    fill_task_errors(seen, model, 0.0, 0.0, J, error, rate, bias)
    for i in range(m):
        own = gains[TIP_GAINS : TIP_GAINS + 3] if i < 3 else gains[RCM_GAINS : RCM_GAINS + 3]
        slope, layer = own[0], own[2]
        s, wanted = rate[i] + slope * error[i], slope * rate[i]
        if gains[INTEGRAL] != 0.0:
            s += slope * (error[i] + slope * memory[i])
            wanted += slope * (rate[i] + slope * error[i])
            if abs(s) < layer:
                memory[i] += seen.dt_s * error[i]
        a[i] = -bias[i] - wanted - own[1] * saturated(s / layer)
    own = gains[JOINT_GAINS : JOINT_GAINS + 3]
    for i in range(n):
        turning = seen.v[i] - seen.qdot_ref[i]
        s = turning + own[0] * (seen.q[i] - seen.q_ref[i])
        posture[i] = -own[0] * turning - own[1] * saturated(s / own[2])
    fill_bias(seen, out[BIAS])
    return GOES_ON if decouple(seen.M, J[3:], a[3:], J[:3], a[:3], posture, out[:3]) else RANK_LOST


@compiled
def saturated(x: float) -> float:
    """X, cut at -1 and 1."""
    return min(max(x, -1.0), 1.0)
