"""Pieces of HTML. Everything that comes from outside passes through `escape`."""

import html
import os
import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from urllib.parse import quote

from surgsim import __version__
from surgsim.report.figures.curves import legend_mark
from surgsim.report.figures.svg import colour

_NOTHING_FROM_OUTSIDE = "default-src 'none'; style-src 'unsafe-inline'; {scripts}img-src data:"
_SCRIPTS = "script-src 'unsafe-inline'; "


def document(title: str, style: str, body: str, script: str = "") -> str:
    """A page that needs nothing but itself, and loads nothing.

    Args:
        title: Plain text.
        style: Its CSS.
        body: Its HTML.
        script: Its JavaScript; without any, none may run.
    """
    scripts, end = (_SCRIPTS, f"<script>{script}</script>\n") if script else ("", "")
    policy = _NOTHING_FROM_OUTSIDE.format(scripts=scripts)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="generator" content="surgsim {__version__}">
<link rel="icon" href="data:,">
<title>{escape(title)}</title>
<style>{style}</style>
</head>
<body>
{body}
{end}</body>
</html>
"""


def escape(text: object) -> str:
    """Text that is safe in an element and in a quoted attribute."""
    return html.escape(str(text), quote=True)


def breakable(name: str) -> str:
    """A name that may be broken after its underscores."""
    return escape(name).replace("_", "_<wbr>")


def heading(words: str) -> str:
    """Words with a unit in brackets, which is not broken."""
    return re.sub(r"\[.*\]", lambda unit: unit[0].replace(" ", "\N{NO-BREAK SPACE}"), escape(words))


def paragraph(text: str, classes: str = "") -> str:
    """A paragraph of plain text; what stands between backticks is set as code."""
    words = re.sub("`([^`]+)`", r"<code>\1</code>", escape(text))
    return f'<p class="{classes}">{words}</p>' if classes else f"<p>{words}</p>"


def section(anchor: str, title: str, *parts: str, level: int = 2) -> str:
    """A section with a heading."""
    body = "\n".join(part for part in parts if part)
    return f'<section id="{escape(anchor)}"><h{level}>{escape(title)}</h{level}>\n{body}\n</section>'


def table(caption: str, head: Iterable[str], rows: Iterable[Sequence[str]], classes: str = "") -> str:
    """A table that scrolls inside its box; `head` and cells are HTML."""
    top = "".join(cell if cell.startswith("<th") else f'<th scope="col">{cell}</th>' for cell in head)
    body = "\n".join("<tr>" + "".join(_cell(cell) for cell in row) + "</tr>" for row in rows)
    return (
        f'<div class="scroll {classes}" tabindex="0" role="region" aria-label="{escape(caption)}">'
        f"<table><thead><tr>{top}</tr></thead>\n<tbody>{body}</tbody></table></div>"
    )


def groups(items: Sequence[str], most: int) -> list[Sequence[str]]:
    """`items` in as few groups of at most `most` as there can be, of nearly the same size."""
    count = -(-len(items) // most)
    bounds = [len(items) * k // count for k in range(count + 1)] if count else []
    return [items[low:high] for low, high in pairwise(bounds)]


def _cell(cell: str) -> str:
    return cell if cell.startswith(("<td", "<th")) else f"<td>{cell}</td>"


def figure(drawing: str, title: str, note: str = "") -> str:
    """A drawing with its caption."""
    small = f"<small>{escape(note)}</small>" if note else ""
    return f"<figure><figcaption>{escape(title)}{small}</figcaption>{drawing}</figure>"


def figures(*drawings: str) -> str:
    """Figures side by side where there is room."""
    there = [drawing for drawing in drawings if drawing]
    wide = " wide" if len(there) in (2, 4) else ""
    return f'<div class="figures{wide}">{"".join(there)}</div>' if there else ""


def details(summary: str, *parts: str, printed: bool = False, small: str = "", anchor: str = "") -> str:
    """Parts that unfold; `printed` ones do so on paper by themselves, `small` is said beside the summary."""
    attributes = (' class="print"' if printed else "") + (f' id="{escape(anchor)}"' if anchor else "")
    beside = f" <small>{escape(small)}</small>" if small else ""
    body = "".join(part for part in parts if part)
    return f"<details{attributes}><summary>{escape(summary)}{beside}</summary>{body}</details>"


def legend(names: Sequence[str]) -> str:
    """Names of the controllers with samples of their lines."""
    items = "".join(f"<li>{legend_mark(index)}{escape(name)}</li>" for index, name in enumerate(names))
    return f'<ul class="legend">{items}</ul>'


def swatch(index: int) -> str:
    """A controller's colour beside its name."""
    return f'<i class="swatch {colour(index)}" aria-hidden="true"></i>'


def link(root: Path, page: Path, target: str, text: str) -> str:
    """A link from `page` to `target` below `root`: relative and quoted, so it can name no other scheme."""
    below = os.path.relpath(root.resolve() / target.lstrip("/"), page.resolve().parent)
    return f'<a href="./{quote(below.replace(os.sep, "/"))}">{escape(text)}</a>'
