"""What the adapters share: where Python finds the reader, and the RCM as rows in the frame of the tip."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "python"))
from surgsim_external import serve

__all__ = ["K_PER_S", "next_target", "rcm_reached", "serve", "trocar_in_tip"]

K_PER_S = 5.0
"""Gain of the feedback of tip and shaft, as surgsim's own resolvers have it."""


def trocar_in_tip(seen):
    """R = R^T (C - p) (3,) [m]: the shaft goes through the trocar where its x and y are zero."""
    return seen["R_WT"].T @ (seen["p_WC"] - seen["p_WT"])


def next_target(seen):
    """Where the tip is to be a period ahead, its error fed back (3,) [m]."""
    wanted = seen["v_WTd"] - K_PER_S * (seen["p_WT"] - seen["p_WTd"])
    return seen["p_WT"] + float(seen["dt_s"]) * wanted


def rcm_reached(seen):
    """Which part of the RCM's error is to go in a period: what K_PER_S takes away in that time."""
    return K_PER_S * float(seen["dt_s"])
