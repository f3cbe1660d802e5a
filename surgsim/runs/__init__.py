"""Runs on disk: one folder each, written whole or not at all."""
