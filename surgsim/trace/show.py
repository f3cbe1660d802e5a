"""How a trace shows itself: what it is of, and each block with its range."""

from collections.abc import Iterator

import numpy as np

from surgsim.columns import Block
from surgsim.display import count, html_table, html_title, number, text_table
from surgsim.trace.trace import Trace

_HEADER = ("block", "columns", "unit", "least", "most")
_RIGHT = (1, 3, 4)


def as_text(trace: Trace) -> str:
    """Plain text within 80 columns."""
    return f"{_title(trace)}\n{text_table(_HEADER, list(_rows(trace)), _RIGHT)}"


def as_html(trace: Trace) -> str:
    """HTML for a notebook."""
    return html_title(_title(trace)) + html_table(_HEADER, list(_rows(trace)), _RIGHT)


def _title(trace: Trace) -> str:
    end = f", {number(float(trace['t_s'][0]))} to {number(float(trace['t_s'][-1]))} s" if len(trace) else ""
    return f"Trace of {count(len(trace), 'row')} and {count(len(trace.columns), 'column')}{end}"


def _rows(trace: Trace) -> Iterator[tuple[str, ...]]:
    for block in trace.blocks:
        least, most = _range(trace, block)
        yield block.name, str(len(block.columns)), block.unit, number(least), number(most)


def _range(trace: Trace, block: Block) -> tuple[float | None, float | None]:
    """Least and largest finite value of a block."""
    values = trace.block(block.name)
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (None, None)
