"""Directives whose content comes from the code: help of commands, metrics, what a scenario can name."""

import argparse
from collections.abc import Sequence
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from surgsim.cli.list import KINDS, items_of
from surgsim.cli.main import build_parser
from surgsim.metrics.catalog import METRICS

_PERSONAL = ("externals",)
"""Kinds that the reader's own files fill."""


class Commands(SphinxDirective):
    """The help of every command, each in a section."""

    def run(self) -> list[nodes.Node]:
        """The sections."""
        parser = build_parser()
        (commands,) = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
        return [
            self._section(f"surgsim {name}", _text(sub.format_help()))
            for name, sub in commands.choices.items()
        ]

    def _section(self, title: str, *content: nodes.Node) -> nodes.section:
        section = nodes.section("", nodes.title(title, title), *content)
        section["names"].append(nodes.fully_normalize_name(title))
        self.state.document.note_implicit_target(section, section)
        return section


class Metrics(SphinxDirective):
    """Every metric: what it is, which way is better, and the smallest difference that matters."""

    def run(self) -> list[nodes.Node]:
        """The table."""
        better = {True: "lower", False: "higher", None: "–"}
        rows = [
            (
                nodes.literal("", metric.name),
                metric.meaning,
                better[metric.lower_is_better],
                f"{metric.matters:g}" if metric.matters else "any",
            )
            for metric in METRICS.values()
        ]
        return [_table(("metric", "meaning", "better", "difference that counts"), (30, 46, 8, 16), rows)]


class Names(Commands):
    """What a scenario can name, a table for each kind."""

    def run(self) -> list[nodes.Node]:
        """The sections."""
        return [
            self._section(kind.replace("-", " ").capitalize(), _names(kind))
            for kind in KINDS
            if kind not in (*_PERSONAL, "metrics")
        ]


def _names(kind: str) -> nodes.Node:
    rows = [(nodes.literal("", name), text) for name, text in items_of(kind)]
    return _table(("name", "what"), (30, 70), rows)


def _text(text: str) -> nodes.literal_block:
    return nodes.literal_block(text, text, language="text")


def _table(
    head: Sequence[str], widths: Sequence[int], rows: Sequence[Sequence[str | nodes.Node]]
) -> nodes.table:
    """A table; a cell is a text or a node."""

    def row(cells: Sequence[str | nodes.Node]) -> nodes.row:
        entries = [
            nodes.entry("", nodes.paragraph("", "", nodes.Text(cell) if isinstance(cell, str) else cell))
            for cell in cells
        ]
        return nodes.row("", *entries)

    group = nodes.tgroup(
        "",
        *(nodes.colspec("", colwidth=width) for width in widths),
        nodes.thead("", row(head)),
        nodes.tbody("", *map(row, rows)),
        cols=len(widths),
    )
    return nodes.table("", group)


def setup(app: Sphinx) -> dict[str, Any]:
    """Add the directives."""
    app.add_directive("surgsim-commands", Commands)
    app.add_directive("surgsim-metrics", Metrics)
    app.add_directive("surgsim-names", Names)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
