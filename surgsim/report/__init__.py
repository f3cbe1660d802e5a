"""The report: one HTML page about a batch, which needs nothing but itself."""
