"""Recordings of runs: written, read back, exported and shown. Importing a module here may load rerun."""
