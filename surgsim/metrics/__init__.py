"""Metrics: pure functions of a trace."""
