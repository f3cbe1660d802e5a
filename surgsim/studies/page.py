"""Parts that every study's README.md has."""

from collections.abc import Sequence

from surgsim.runs.provenance import provenance
from surgsim.studies.study import Claim, markdown_table


def claims_table(claims: Sequence[Claim]) -> str:
    """The claims in Markdown."""
    rows = [
        {"claim": c.text, "by": c.source, "verdict": f"**{c.verdict}**", "evidence": c.evidence}
        for c in claims
    ]
    return markdown_table(rows)


def pictures(figures: Sequence[str], wanted: Sequence[str]) -> list[str]:
    """Markdown of those `wanted` files that were drawn."""
    return [f"![{name.removesuffix('.png').replace('_', ' ')}]({name})" for name in wanted if name in figures]


def versions() -> str:
    """Versions of surgsim, Python and the numerical packages, in a sentence's part."""
    found = provenance()
    packages = ", ".join(f"{name} {found['packages'][name]}" for name in ("mujoco", "numpy", "scipy"))
    return f"surgsim {found['surgsim']}, Python {found['python']}, {packages}"
