"""What the two sides tell each other: a row of numbers, in remote world axes.

From the operator's side: the tip's position and velocity that the handle stands for, how far the jaws
close, and the instrument's roll and its rate. From the remote side: the tip's position, also what the screen
shows, and the force of the tip on its environment. A bilateral scheme may send something else in the places
of velocity and force.
"""

from typing import Literal

PassivityMode = Literal["tank", "tdpa", "off"]
TANK, TDPA, OFF, SCHEME = range(4)
MODES: dict[PassivityMode, int] = {"tank": TANK, "tdpa": TDPA, "off": OFF}
"""The number that stands for a mode in a record; SCHEME: a bilateral scheme decides."""

POSITION, VELOCITY, FORCE, JAW, ROLL, ROLL_RATE, CONTENT = 0, 3, 6, 9, 10, 11, 12
"""Where in a message position (3,) [m], velocity (3,) [m/s], force (3,) [N], jaw, roll [rad] and its rate
[rad/s] are; its length."""
