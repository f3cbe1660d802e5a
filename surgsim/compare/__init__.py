"""Batch comparisons: suites of runs, the engine that runs them, the table of their results."""
