"""What shipped controllers need of a scenario, for tests that run all of them."""

FEELS = ("rcm_interaction_force", "rcm_port_admittance")
"""Those that feel for the wall around the trocar."""
