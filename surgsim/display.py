"""How objects show themselves in a session: plain text within 80 columns, and HTML for notebooks."""

import html
import math
from collections.abc import Collection, Iterable, Sequence

WIDTH = 80
"""Columns that plain text keeps to."""

_TABLE = "border-collapse:collapse;font-variant-numeric:tabular-nums"
_CELL = "padding:2px 10px 2px 0;text-align:{};white-space:nowrap"


def number(value: float | None, digits: int = 4) -> str:
    """A figure with `digits` significant digits; a dash where it is not defined.

    Example:
        >>> number(0.0123456), number(None)
        ('0.01235', '-')
    """
    if value is None or math.isnan(value):
        return "-"
    if value == 0.0:
        return "0"
    if 1e-3 <= abs(value) < 1e5:
        return f"{value:.{max(0, digits - 1 - math.floor(math.log10(abs(value))))}f}"
    return f"{value:.{digits - 1}e}"


def count(amount: int, noun: str) -> str:
    """An amount with its noun, e.g. `1 run`, `2 runs`, `3 pushes`."""
    ending = "" if amount == 1 else "es" if noun.endswith("sh") else "s"
    return f"{amount} {noun}{ending}"


def text_table(header: Sequence[str], rows: Sequence[Sequence[str]], right: Collection[int] = ()) -> str:
    """Lines of a table, two spaces between columns, those in `right` right-aligned."""
    table = [header, *rows]
    widths = [max(len(row[column]) for row in table) for column in range(len(header))]
    lines = []
    for row in table:
        cells = [
            cell.rjust(width) if column in right else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def html_table(header: Sequence[str], rows: Sequence[Sequence[str]], right: Collection[int] = ()) -> str:
    """The same table in HTML, every cell escaped."""

    def line(tag: str, cells: Sequence[str]) -> str:
        sides = ("right" if column in right else "left" for column in range(len(cells)))
        return "".join(
            f'<{tag} style="{_CELL.format(side)}">{html.escape(cell)}</{tag}>'
            for side, cell in zip(sides, cells, strict=True)
        )

    body = "".join(f"<tr>{line('td', row)}</tr>" for row in rows)
    return (
        f'<table style="{_TABLE}"><thead><tr>{line("th", header)}</tr></thead><tbody>{body}</tbody></table>'
    )


def html_title(title: str, *lines: str) -> str:
    """A heading in bold with lines below it, escaped."""
    rest = "".join(f"<div>{html.escape(line)}</div>" for line in lines if line)
    return f"<div><b>{html.escape(title)}</b></div>{rest}"


def joined_names(names: Iterable[str]) -> str:
    """Names, each once, with a plus between them."""
    return "+".join(dict.fromkeys(names))
