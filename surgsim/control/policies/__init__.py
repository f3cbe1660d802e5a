"""Policies: callables from what a controller sees to what it should do."""
