"""Differences of a bundle as a person reads them: a line each."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surgsim.protocol.findings import Finding

MOST = 40
"""Lines that are printed; --json has all."""


def print_findings(findings: "Sequence[Finding]") -> None:
    """Print each on its own line; of many the first ones, and how many more there are."""
    for finding in findings[:MOST]:
        print(finding.line)
    if len(findings) > MOST:
        print(f"and {len(findings) - MOST} more differences; --json lists all")
