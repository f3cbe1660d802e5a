"""Where things really are, for the trace and the safety limits: never shown to a controller."""

from dataclasses import dataclass, field

import numpy as np

from surgsim.array import Array

NOWHERE = np.full(3, np.nan)
NOWHERE.flags.writeable = False
NO_VALUES = np.zeros(0)
NO_VALUES.flags.writeable = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """A contact that must not be.

    Attributes:
        detail: What touches what and how deep, in words.
        with_patient: Whether patient or table are touched, not the arm itself.
    """

    detail: str
    with_patient: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """True motion of arm, instrument and port, world frame.

    Attributes:
        q: Joint positions (n,) [rad].
        v: Joint velocities (n,) [rad/s].
        p_WT: Tip (3,) [m].
        p_WS: End of the shaft: the tip of a straight instrument (3,) [m].
        p_WR: Wrist: the shaft's second point (3,) [m].
        p_WC: Trocar: the incision at rest, breathing included (3,) [m]; NaN without one.
        f_C: Force of the shaft on the abdominal wall (3,) [N]; NaN without a physical wall.
        f_T: Force of the surroundings on the tip (3,) [N]; NaN where nothing can touch it.
        contact: Forbidden contact, or None.
        values: Values of the plant's own columns (k,).
    """

    q: Array
    v: Array
    p_WT: Array
    p_WS: Array
    p_WR: Array
    p_WC: Array
    f_C: Array = field(default_factory=lambda: NOWHERE)
    f_T: Array = field(default_factory=lambda: NOWHERE)
    contact: Contact | None = None
    values: Array = field(default_factory=lambda: NO_VALUES)
