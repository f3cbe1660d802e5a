"""Inverse kinematics libraries on the kinematic RCM circle.

`problem` is what all of them solve, `arm_files` the arm as they read it, `with_...` one library each, and
`measure` their times and errors.
"""
