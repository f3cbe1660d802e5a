"""What stands on the operator's screen beside the picture."""

from dataclasses import dataclass

_SLOW = 0.95


@dataclass(frozen=True, kw_only=True)
class Status:
    """Lines of text.

    Attributes:
        lines: Names and values.
        help: The keys, parted by " | ".
    """

    lines: tuple[tuple[str, str], ...]
    help: str


def status(
    *,
    t_s: float,
    duration_s: float,
    factor: float,
    speed_m_per_s: float,
    jaw: float,
    clutch: bool,
    force_n: float,
    help: str,
) -> Status:
    """What is worth knowing; `factor` is simulated over wall time, `force_n` what the console renders."""
    slow = " - this computer is too slow for real time" if factor < _SLOW else ""
    return Status(
        lines=(
            ("time", f"{t_s:.1f} of {duration_s:g} s"),
            ("real time", f"{factor:.2f}x{slow}"),
            ("speed", f"{1e3 * speed_m_per_s:g} mm/s"),
            ("jaws", "closing" if jaw > 0.5 else "open"),
            ("clutch", "open" if clutch else "closed"),
            ("force on the hand", f"{force_n:.1f} N"),
        ),
        help=help,
    )
