"""Delayed bilateral teleoperation: console, operator, channel, energy tanks and the two ends."""
