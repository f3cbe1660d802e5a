"""A table as papers print it: TeX, Markdown and CSV of the same columns."""

import csv
import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from surgsim.studies.tables import Cell

_SPACE = "\N{NO-BREAK SPACE}"
_MINUS = "\N{MINUS SIGN}"
_TEX = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{letter: f"\\{letter}" for letter in "&%$#_{}"},
    "<": "$<$",
    ">": "$>$",
    "|": "$|$",
    _MINUS: "$-$",
    "±": r"$\pm$",
    "×": r"$\times$",
    "·": r"$\cdot$",
    "²": "$^2$",
    "³": "$^3$",
    "°": r"$^\circ$",
    "µ": r"$\mu$",
    "μ": r"$\mu$",
    "–": "--",
    _SPACE: "~",
}
_EXPONENT = re.compile(r"^(-?\d(?:\.\d+)?)e([-+]?\d+)$")


@dataclass(frozen=True, kw_only=True)
class PaperColumn:
    """A column as it is read, and as it is computed with.

    Attributes:
        heading: What stands above it, with the unit.
        texts: Its cells for a person.
        cells: The same for a program: by name, in full; the names end with their units.
        right: Whether it is right-aligned, as numbers are.
        group: What stands above this column and its neighbours; may be empty.
    """

    heading: str
    texts: Sequence[str]
    cells: Mapping[str, Sequence[Cell]]
    right: bool = True
    group: str = ""


@dataclass(frozen=True, kw_only=True)
class PaperTable:
    """A table.

    Attributes:
        columns: Its columns, of equal length.
        note: What its figures are, in sentences; may be empty.
    """

    columns: Sequence[PaperColumn]
    note: str = ""
    rows: int = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", len(self.columns[0].texts))

    def row(self, index: int) -> list[str]:
        """The cells of a row, for a person."""
        return [column.texts[index] for column in self.columns]


def tex(table: PaperTable) -> str:
    """A `tabular` with the rules of booktabs; the note is a comment."""
    columns = table.columns
    lines = ["% Written by surgsim export. In the preamble: \\usepackage{booktabs}"]
    lines += [f"% {table.note}"] if table.note else []
    lines += [rf"\begin{{tabular}}{{{''.join('r' if column.right else 'l' for column in columns)}}}"]
    lines += [r"\toprule", *_tex_groups(columns), _tex_row([column.heading for column in columns])]
    lines += [r"\midrule", *(_tex_row(table.row(index)) for index in range(table.rows))]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def _tex_groups(columns: Sequence[PaperColumn]) -> list[str]:
    """The line of the groups, and the rules below them; none without groups."""
    spans = [(group, len(list(members))) for group, members in groupby(columns, lambda one: one.group)]
    if not any(group for group, _ in spans):
        return []
    cells, rules, first = [], [], 1
    for group, width in spans:
        cells.append(rf"\multicolumn{{{width}}}{{c}}{{{tex_text(group)}}}" if group else " & " * (width - 1))
        rules += [rf"\cmidrule(lr){{{first}-{first + width - 1}}}"] if group else []
        first += width
    return [" & ".join(cells) + r" \\", "".join(rules)]


def _tex_row(cells: Sequence[str]) -> str:
    line = " & ".join(tex_text(cell) for cell in cells)
    guarded = f"{{}}{line}" if line.startswith(("[", "*")) else line  # \\[ and \\* mean something else
    return rf"{guarded} \\"


def tex_text(text: str) -> str:
    """`text` as TeX shows it: what means something to it escaped, minus signs and powers of ten set."""
    if found := _EXPONENT.match(text.replace(_MINUS, "-")):
        return rf"${found[1]}\times10^{{{int(found[2])}}}$"
    return "".join(_TEX.get(letter, letter) for letter in text)


def markdown(table: PaperTable) -> str:
    """A table of Markdown, the note below it; spaces inside cells of numbers break no line."""
    columns = table.columns
    headings = [f"{column.group}: {column.heading}" if column.group else column.heading for column in columns]
    lines = [_markdown_row(headings), "|" + "|".join("---:" if c.right else "---" for c in columns) + "|"]
    for index in range(table.rows):
        cells = [c.texts[index].replace(" ", _SPACE) if c.right else c.texts[index] for c in columns]
        lines.append(_markdown_row(cells))
    return "\n".join([*lines, *(["", table.note] if table.note else []), ""])


def _markdown_row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def comma_separated(table: PaperTable) -> str:
    """CSV for programs: every number in full, an empty field where there is none."""
    named = {name: cells for column in table.columns for name, cells in column.cells.items()}
    content = io.StringIO(newline="")
    writer = csv.writer(content, lineterminator="\n")
    writer.writerow(named)
    for row in zip(*named.values(), strict=True):
        writer.writerow(
            ["" if cell is None else repr(cell) if isinstance(cell, float) else cell for cell in row]
        )
    return content.getvalue()


WRITERS: Mapping[str, Callable[[PaperTable], str]] = {
    ".csv": comma_separated,
    ".md": markdown,
    ".tex": tex,
}
