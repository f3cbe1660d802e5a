"""Tuning: gains that make a controller accurate, found by runs, and how far they are from failing."""
