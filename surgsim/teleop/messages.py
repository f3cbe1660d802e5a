"""What the two sides tell each other: a row of numbers, in remote world axes.

From the operator's side: the tip's position and velocity that the handle stands for, and how far the jaws
close. From the remote side: the tip's position, also what the screen shows, and the force of the tip on its
environment, which is shown and not used by the force law.
"""

from typing import Literal

PassivityMode = Literal["tank", "tdpa", "off"]
TANK, TDPA, OFF = range(3)
MODES: dict[PassivityMode, int] = {"tank": TANK, "tdpa": TDPA, "off": OFF}
"""The number that stands for a mode in a record."""

POSITION, VELOCITY, FORCE, JAW, CONTENT = 0, 3, 3, 6, 7
"""Where in a message position (3,) [m], velocity (3,) [m/s] or force (3,) [N], and jaw are; its length."""
