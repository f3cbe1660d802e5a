"""The paper's figures beside ours."""

from collections.abc import Sequence

from surgsim.studies.study import Cell, Row

PAPER_RCM_MM = 0.3
PAPER_VELOCITY_MM_PER_S = 4.7

_LINES: tuple[tuple[str, str, Cell], ...] = (
    ("RCM error, RMS (mm)", "rcm_rms_mm", PAPER_RCM_MM),
    ("RCM error, largest (mm)", "rcm_max_mm", None),
    ("velocity error, aligned (mm/s)", "velocity_aligned_mm_per_s", PAPER_VELOCITY_MM_PER_S),
    ("velocity error, not aligned (mm/s)", "velocity_unaligned_mm_per_s", PAPER_VELOCITY_MM_PER_S),
    ("velocity error, all ticks (mm/s)", "velocity_all_ticks_mm_per_s", PAPER_VELOCITY_MM_PER_S),
    ("lowest tank (J)", "tank_min_j", None),
    ("largest slack (mm/s)", "slack_max_mm_per_s", None),
    ("largest slack, nothing active (mm/s)", "slack_free_max_mm_per_s", None),
    ("a plane acts (% of ticks)", "planes_percent", None),
    ("times that a plane began to act", "plane_contacts", None),
    ("tip past a plane (mm)", "plane_overshoot_mm", None),
    ("command above the speed limit (% of ticks)", "speed_limit_percent", None),
    ("speed limit of an axis (mm/s)", "tip_speed_limit_mm_per_s", None),
    ("fastest tip along an axis (mm/s)", "tip_speed_max_mm_per_s", None),
    ("the energy budget acts (% of ticks)", "passivity_percent", None),
    ("the operator's tank limits the force (% of ticks)", "force_scaled_percent", None),
    ("rings transferred", "rings_transferred", None),
    ("rings dropped", "ring_drops", None),
    ("unexplained energy (% of exchanged)", "energy_residual_percent", None),
    ("duration (s)", "duration_s", None),
)


def beside_the_paper(scenarios: Sequence[Row]) -> list[Row]:
    """One line for each figure: the paper's, then ours in every scenario."""
    return [
        {"figure": words, "paper": paper, **{str(row["scenario"]): row[column] for row in scenarios}}
        for words, column, paper in _LINES
    ]
