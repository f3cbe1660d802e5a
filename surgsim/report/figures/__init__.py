"""Figures of the report, drawn as inline SVG that takes its colours from the page."""
