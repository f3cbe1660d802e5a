"""What shipped controllers need of a scenario, for tests that run all of them."""

_WALL, _SENSOR = "trocar.wall={}", "disturbances=[{type: force_torque_sensor}]"
NEEDS = {
    "rcm_interaction_force": (_WALL,),
    "rcm_port_admittance": (_WALL, _SENSOR),
    "hands_on_admittance": (_SENSOR,),
}
"""Assignments by controller: those that feel for a wall, or for a hand."""
