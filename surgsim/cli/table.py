"""Tables and sentences that fit the terminal. No number and no word is broken across lines.

A table takes the first form that fits: a line a row, with prose wrapped between words; the first column on a
line of its own above the others; or every cell on a line of its own.
"""

import os
import sys
import textwrap
from collections.abc import Collection, Sequence
from typing import TextIO

_GAP = 2
_INDENT = 2
_ELSEWHERE = 110  # columns, where standard output is no terminal
_NARROWEST_PROSE = 20
Lines = list[str]


def print_table(
    title: str,
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    right: Collection[int] = (),
    *,
    whole: bool = False,
) -> None:
    """Print a table.

    Args:
        title: Its heading.
        header: A heading for each column.
        rows: The cells.
        right: Columns of numbers: right-aligned.
        whole: Whether each row stays on one line where standard output is no terminal, however long it is.
    """
    from rich.console import Console
    from rich.text import Text

    width = terminal_width(sys.stdout)
    if whole and not sys.stdout.isatty():
        width = sys.maxsize
    headings, body = fit_table(header, rows, right, width)
    console = Console(highlight=False)
    for line in fit_prose(title, width):
        console.print(Text(line, style="italic"), soft_wrap=True)
    for line in headings:
        console.print(Text(line, style="bold"), soft_wrap=True)
    for line in body:
        print(line)


def print_prose(text: str, file: TextIO | None = None) -> None:
    """Print a sentence: broken between words on a terminal, on one line elsewhere."""
    file = file or sys.stdout
    lines = fit_prose(text, terminal_width(file)) if file.isatty() else [text]
    print("\n".join(lines), file=file, flush=True)


def print_beside(head: str, *texts: str) -> None:
    """Print sentences below each other, to the right of `head`; broken between words on a terminal."""
    room = terminal_width(sys.stdout) - _len(head)
    for text in texts:
        for line in fit_prose(text, room) if sys.stdout.isatty() else [text]:
            print(head + line)
            head = " " * _len(head)


def print_text(text: str) -> None:
    """Print lines; on a terminal, what is too long goes on below, deeper, as YAML allows."""
    width = terminal_width(sys.stdout)
    for line in text.splitlines():
        inner = line.lstrip()
        if not sys.stdout.isatty() or _len(line) <= width:
            print(line)
            continue
        indent = " " * (len(line) - len(inner))
        first, *others = fit_prose(inner, width - len(indent) - 2 * _INDENT)
        print("\n".join([indent + first, *(f"{indent}{' ' * 2 * _INDENT}{other}" for other in others)]))


def terminal_width(file: TextIO) -> int:
    """Columns of the terminal that `file` is, or of a page elsewhere."""
    try:
        columns = os.get_terminal_size(file.fileno()).columns
    except (OSError, ValueError):
        return _ELSEWHERE
    return columns or 80  # a terminal that does not say


def fit_prose(text: str, width: int) -> Lines:
    """`text` in lines of at most `width`, broken between words; a longer word has a line of its own."""
    lines = textwrap.wrap(text, max(1, width), break_long_words=False, break_on_hyphens=False)
    return lines or [""]


def fit_table(
    header: Sequence[str], rows: Sequence[Sequence[str]], right: Collection[int], width: int
) -> tuple[Lines, Lines]:
    """The lines of a table's header and of its body, in the first form that fits into `width`."""
    cells = [header, *rows]
    columns = range(len(header))
    if widths := _widths(cells, right, width):
        first, *others = [_row(row, widths, right) for row in cells]
        return first, [line for lines in others for line in lines]
    rest = [row[1:] for row in cells]
    beside = {index - 1 for index in right}
    if len(columns) > 2 and (widths := _widths(rest, beside, width - _INDENT)):
        first, *others = [_indented(_row(row, widths, beside)) for row in rest]
        named = zip(rows, others, strict=True)
        return [header[0], *first], [line for row, lines in named for line in (row[0], *lines)]
    return [], [line for row in rows for line in _stacked(header, row, width)]


def _widths(cells: Sequence[Sequence[str]], right: Collection[int], width: int) -> list[int] | None:
    """The width of each column if they fit side by side; those of prose give way."""
    natural, least = [], []
    for index, column in enumerate(zip(*cells, strict=True)):
        heading, *body = column
        words = max((_len(word) for word in heading.split()), default=0)
        full = max([words, *map(_len, body)])
        prose = index not in right and any(" " in cell for cell in body)
        longest = max([words, *(_len(word) for cell in body for word in cell.split())])
        natural.append(max(full, _len(heading)))
        least.append(max(longest, min(full, _NARROWEST_PROSE)) if prose else full)
    room = width - _GAP * (len(natural) - 1)
    if sum(least) > room:
        return None
    while sum(natural) > room:
        widest = max((i for i, n in enumerate(natural) if n > least[i]), key=lambda i: natural[i])
        natural[widest] -= 1
    return natural


def _row(row: Sequence[str], widths: Sequence[int], right: Collection[int]) -> Lines:
    """A row of cells, in as many lines as its longest cell needs."""
    wrapped = [fit_prose(cell, width) for cell, width in zip(row, widths, strict=True)]
    lines = []
    for height in range(max(map(len, wrapped))):
        parts = []
        for index, (cell, width) in enumerate(zip(wrapped, widths, strict=True)):
            text = cell[height] if height < len(cell) else ""
            space = " " * (width - _len(text))
            parts.append(space + text if index in right else text + space)
        lines.append((" " * _GAP).join(parts).rstrip())
    return lines


def _stacked(header: Sequence[str], row: Sequence[str], width: int) -> Lines:
    """A row as a line a cell: the first one alone, the others with their headings."""
    lines = [row[0]]
    for heading, cell in zip(header[1:], row[1:], strict=True):
        lines += _indented(fit_prose(f"{heading}: {cell}", width - _INDENT))
    return lines


def _indented(lines: Lines) -> Lines:
    return [" " * _INDENT + line for line in lines]


def _len(text: str) -> int:
    """Columns that `text` takes on a terminal."""
    if text.isascii():
        return len(text)
    from rich.cells import cell_len

    return cell_len(text)
