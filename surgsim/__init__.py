"""Benchmark for controllers that move an instrument through a trocar, on MuJoCo."""

__version__ = "0.1.0"
