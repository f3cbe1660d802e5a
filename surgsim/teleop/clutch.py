"""When the simulated operator re-indexes the handle with the clutch."""

from pydantic import PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.teleop.console import ConsoleState
from surgsim.teleop.reach import Reach
from surgsim.tick.arrays import Record


class ClutchConfig(PartConfig):
    """Whether the operator uses the clutch, and how near to a joint's stop of the console; an assumption.

    A movement that leads the handle nearer to its stop than `stop_margin_rad` is broken off: the operator
    opens the clutch, goes back with the handle to where it was at first, closes the clutch, looks, and goes
    on. The margin covers what the hand goes on by while the clutch opens.
    """

    use: bool = False
    stop_margin_rad: PositiveFloat = 0.15


class ClutchLaw(Record):
    """Numbers of re-indexing: as in `ClutchConfig`, and how long the clutch takes to open.

    Attributes:
        use: Whether it is used.
        stop_margin_rad: As in the config.
        fade_s: Time from closed to open [s].
    """

    use: int
    stop_margin_rad: float
    fade_s: float


@compiled
def leaves_no_room(law: ClutchLaw, reach: Reach, home: Array, handle: ConsoleState) -> bool:
    """Whether the handle is near its stop, and the movement leads it further from `home` (3,) [m]."""
    if not law.use or handle.room_rad >= law.stop_margin_rad:
        return False
    outward = 0.0
    for i in range(3):
        outward += reach.change[i] * (handle.position[i] - home[i])
    return outward > 0.0
