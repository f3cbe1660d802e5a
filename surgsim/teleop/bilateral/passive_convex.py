"""The passive convex optimal control paper's scheme: a spring to the delayed tip, a velocity for the arm."""

from typing import Literal

from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.catalog import PartConfig
from surgsim.teleop.messages import PassivityMode
from surgsim.teleop.passivity_control import PassivityControlConfig
from surgsim.teleop.tank import TankConfig


class PassiveConvexConfig(PartConfig):
    """Passive convex optimal control (the default): velocity to the arm's program, a spring to the hand.

        F_O = K_v (x_r(t - T2) - x_o),   v_d = trust (v + k (x - x_r))

    Attributes:
        passivity: Energy tanks, the time-domain passivity controller, or nothing.
        stiffness_n_per_m: K_v of the force law, per metre of handle motion [N/m].
        refill_damping_ns_per_mj: Damper on the handle per joule that its tank lacks; 0: none.
        drift_gain_per_s: Pull of the tip to the master's position beside its velocity; 0: none [1/s].
        drift_speed_m_per_s: Limit of that pull [m/s].
        tanks: The energy tank of each side.
        passivity_control: The passivity controller of each side.
    """

    type: Literal["passive_convex"] = "passive_convex"
    passivity: PassivityMode = "tank"
    stiffness_n_per_m: NonNegativeFloat = 60.0
    refill_damping_ns_per_mj: NonNegativeFloat = 20.0
    drift_gain_per_s: NonNegativeFloat = 2.0
    drift_speed_m_per_s: PositiveFloat = 0.02
    tanks: TankConfig = TankConfig()
    passivity_control: PassivityControlConfig = PassivityControlConfig()

    def build(self, period_s: float, round_trip_s: float) -> None:
        """Nothing: both sides of the task have this law built in, `operator_side` and `remote_side`.

        It works on what no other scheme needs: the console's limits before its tank, and a budget that the
        arm's program keeps.
        """
