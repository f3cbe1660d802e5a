"""A person operates the master console while the simulation runs in a window."""
