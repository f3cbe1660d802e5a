"""What a kernel answers: 0 goes on, anything else stops the tick."""

GOES_ON = 0
INFEASIBLE = 1
"""No command meets the hard constraints."""
RANK_LOST = 2
"""A Jacobian that has to be inverted has lost rank."""
DIVERGED = 3
"""A state of the part has grown past all bounds."""
TOLD = 4
"""A Python part says why itself (`surgsim.tick.python_part`)."""
TORQUE_RATE = 5
"""The commanded torque changes faster than the arm's interface takes."""
EXTERNAL = 6
"""A controller outside surgsim gave no answer (`surgsim.control.external`)."""
JOINT_ACCELERATION = 7
"""The commanded joint motion accelerates more than the arm's interface takes."""
JOINT_JERK = 8
"""The commanded joint motion has more jerk than the arm's interface takes."""
PACKETS_LOST = 9
"""So many commands in a row were lost that the arm gives up."""
