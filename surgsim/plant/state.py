"""What the plant lets a controller see."""

from dataclasses import dataclass, field

import numpy as np

from surgsim.array import Array

NO_FORCE = np.zeros(3)
NO_FORCE.flags.writeable = False
NO_PLACE, NO_TURN = np.full(3, np.nan), np.full((3, 3), np.nan)
NO_PLACE.flags.writeable = NO_TURN.flags.writeable = False


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackedPose:
    """The last pose of the instrument that a tracker measured, world frame.

    Attributes:
        samples: Poses measured so far; 0: there is none.
        age_s: How much older it is than the joint positions of the same state [s].
        p_WT: Tip position (3,) [m]; NaN without one.
        R_WT: Tip orientation (3, 3).
    """

    samples: int = 0
    age_s: float = 0.0
    p_WT: Array = field(default_factory=lambda: NO_PLACE)
    R_WT: Array = field(default_factory=lambda: NO_TURN)


NOT_TRACKED = TrackedPose()


@dataclass(frozen=True, slots=True, kw_only=True)
class Wrench:
    """What the surroundings do to the instrument, as a force-torque sensor at the flange measures it.

    Attributes:
        force: World frame (3,) [N]; the instrument's weight is taken off.
        moment: About the tip (3,) [N m].
    """

    force: Array
    moment: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Measured state of the plant at a control tick. Arrays are the reader's own.

    Attributes:
        t_s: Time since the reset [s].
        q: Joint positions (n,) [rad].
        v: Joint velocities (n,) [rad/s].
        tau: Joint torques that the actuators gave over the last period (n,) [N m].
        p_WC: Trocar position, world frame (3,) [m]; NaN without a trocar.
        v_WC: Trocar velocity as announced to the controller (3,) [m/s]; zeros where nobody announces it.
        f_T: Force of the surroundings on the tip, as a sensor at the tip measures it, world frame (3,) [N].
        tracked: What a tracker says of the instrument.
        wrench: What a force-torque sensor at the flange measures; None without one.
    """

    t_s: float
    q: Array
    v: Array
    tau: Array
    p_WC: Array
    v_WC: Array
    f_T: Array = field(default_factory=lambda: NO_FORCE)
    tracked: TrackedPose = NOT_TRACKED
    wrench: Wrench | None = None
