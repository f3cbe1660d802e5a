"""Running a scenario: setup, the control loop, safety, the trace."""
