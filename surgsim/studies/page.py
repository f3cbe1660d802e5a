"""The page of a study: README.md of its result folder."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from surgsim.runs.provenance import provenance
from surgsim.studies.study import Finding, Section, Study
from surgsim.studies.tables import Tables, markdown_table


def write_page(
    path: Path,
    study: Study,
    tables: Tables,
    findings: Sequence[Finding],
    figures: Sequence[str],
    *,
    quick: bool,
) -> None:
    """Write the page: command, versions, claims, sections.

    Args:
        path: The file.
        study: The declaration.
        tables: The tables that there are.
        findings: The claims that were checked.
        figures: Files of the figures that were drawn.
        quick: Whether the run was quick.
    """
    command = f"surgsim reproduce {study.name}" + (" --quick" if quick else "")
    parts = [f"# {study.heading}", _introduction(study, command)]
    if quick:
        parts.append(f"This is a quick run: {study.quick_note}.")
    parts += ["## Claims", claims_table(findings)]
    for section in study.sections:
        parts += _section(section, tables, figures)
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def _introduction(study: Study, command: str) -> str:
    paper = {"title": study.paper.title, "reference": study.paper.reference}
    return study.introduction.format(**paper, command=command, versions=versions())


def _section(section: Section, tables: Tables, figures: Sequence[str]) -> Iterable[str]:
    if section.table is not None and section.table not in tables:
        return
    yield section.text if isinstance(section.text, str) else section.text(tables)
    rows = section.rows if section.table is None else tables[section.table]
    if section.columns:
        rows = [{name: row[name] for name in section.columns} for row in rows]
    if rows:
        yield markdown_table(rows, section.digits)
    for name in section.figures:
        if name in figures:
            yield f"![{name.removesuffix('.png').replace('_', ' ')}]({name})"


def claims_table(findings: Iterable[Finding]) -> str:
    """The claims in Markdown."""
    rows = [
        {"claim": f.text, "by": f.source, "verdict": f"**{f.verdict}**", "evidence": f.evidence}
        for f in findings
    ]
    return markdown_table(rows)


def versions() -> str:
    """Versions of surgsim, Python and the numerical packages, in a sentence's part."""
    found = provenance()
    packages = ", ".join(f"{name} {found['packages'][name]}" for name in ("mujoco", "numpy", "scipy"))
    return f"surgsim {found['surgsim']}, Python {found['python']}, {packages}"
