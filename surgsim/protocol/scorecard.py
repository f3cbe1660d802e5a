"""The scorecard: what a score comes to, in about ten numbers."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from surgsim.protocol.definition import Protocol
from surgsim.protocol.figures import figures_of
from surgsim.protocol.levels import axis_results, reason_of
from surgsim.protocol.rows import Row


def scorecard(
    rows: Sequence[Row],
    protocol: Protocol,
    *,
    protocol_sha256: str,
    track: str,
    arms: Sequence[str],
    seeds: Mapping[str, str],
    definition_sha256: str,
    tuning: Mapping[str, Any],
) -> dict[str, Any]:
    """The scorecard as plain data: nothing in it depends on time, machine or place.

    Failures stand first: how many runs of which kind, then figures, then axes.
    """
    config = protocol.config
    axes = axis_results(rows, config, config.tracks[track].generators)
    figures = figures_of(rows, axes, config)
    return {
        "protocol": protocol.name,
        "protocol_sha256": protocol_sha256,
        "track": track,
        "arms": list(arms),
        "seeds": dict(seeds),
        "definition_sha256": definition_sha256,
        "runs": sum(row.counts for row in rows),
        "unreachable": sum(not row.counts for row in rows),
        "failures": failures(rows),
        "figures": {name: asdict(figure) for name, figure in figures.items()},
        "axes": [asdict(axis) for axis in axes],
        "tuning": dict(tuning),
    }


def failures(rows: Sequence[Row]) -> dict[str, int]:
    """Runs that failed, by reason, the most frequent first."""
    counts = Counter(reason_of(row) for row in rows if row.counts and row.failed)
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))
