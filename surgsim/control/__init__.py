"""Controllers: a velocity-level redundancy resolver and a torque-level law."""
