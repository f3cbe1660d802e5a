"""The trace of a run: named columns with units, the one source of metrics, plots and recordings."""
