"""The passport as a page: sentence, scorecard, and the axes as a chart of words and marks."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from surgsim.protocol.definition import ProtocolConfig
from surgsim.protocol.score import Score
from surgsim.protocol.score_text import axis_told, figure_told, sentence, timing_told, tuning_told
from surgsim.report import html

MARKS = ("●", "■", "▲", "◆", "▼", "✚", "✖", "★")
"""Shapes tell controllers apart where colours do not."""


def passport_page(score: Score, others: Sequence[Score], protocol: ProtocolConfig) -> str:
    """The page as one string; it needs nothing but itself."""
    first, *rest = sentence(score)
    lead = f'<p class="lead">{html.escape(first)}</p>' + "".join(html.paragraph(line) for line in rest)
    parts = [
        _axes_section(score, others),
        _card_section(score, others, protocol),
        _origin_section(score),
    ]
    return document(f"{score.name}: robustness passport", lead, "\n".join(filter(None, parts)))


def document(title: str, lead: str, body: str) -> str:
    """A page of its own, with the style of reports."""
    report_style = Path(html.__file__).with_name("page.css").read_text(encoding="utf-8")
    style = report_style + Path(__file__).with_name("passport.css").read_text(encoding="utf-8")
    words = f"<h1>{html.escape(title)}</h1>\n{lead}"
    top = f'<header><div><div class="words">{words}</div></div></header>'
    return html.document(title, style, f"{top}\n<main>\n{body}\n</main>")


def _axes_section(score: Score, others: Sequence[Score]) -> str:
    """The first failing level on every axis, beside the others'."""
    axes = score.scorecard["axes"]
    if not axes:
        return ""
    everyone = [score, *others]
    legend = "".join(f"<li>{_mark(i)} {html.breakable(who.name)}</li>" for i, who in enumerate(everyone))
    told = (
        "One quantity is made harder at a time. A mark stands at the first level with a run that failed; "
        "at the right end stands who holds all levels."
    )
    rows = "\n".join(_axis(axis, everyone) for axis in axes)
    return html.section(
        "axes",
        "First failing level",
        html.paragraph(told),
        f'<ul class="legend">{legend}</ul>',
        f'<div class="axes">{rows}</div>',
    )


def _axis(axis: Mapping[str, Any], everyone: Sequence[Score]) -> str:
    key, levels, own = (axis["generator"], axis["axis"]), axis["levels"], axis["first_failing"]
    end = len(levels) if own is None else own
    marks: dict[int, list[str]] = {}
    for i, who in enumerate(everyone):
        found = {(each["generator"], each["axis"]): each["first_failing"] for each in who.scorecard["axes"]}
        if key in found:
            place = len(levels) if found[key] is None else found[key]
            marks.setdefault(place, []).append(_mark(i, who.name))
    boxes = [_box(_level(level), place, end, marks.get(place, [])) for place, level in enumerate(levels)]
    boxes.append(_box("holds all", len(levels), end, marks.get(len(levels), []), last=True))
    title = f"<h3>{html.heading(axis['label'])}<small>{html.escape(axis_told(axis))}</small></h3>"
    return f'<div class="axis">{title}<ol class="levels">{"".join(boxes)}</ol></div>'


def _level(level: Mapping[str, Any]) -> str:
    return "as is" if level["level"] is None else f"{level['level']:g}"


def _box(text: str, place: int, end: int, marks: Sequence[str], *, last: bool = False) -> str:
    names = ["reached"] * (place < end) + ["fails"] * (place == end and not last) + ["all"] * last
    attribute = f' class="{" ".join(names)}"' if names else ""
    return f'<li{attribute}><span class="marks">{"".join(marks)}</span><span>{html.escape(text)}</span></li>'


def _mark(i: int, name: str = "") -> str:
    own = " own" if i == 0 else ""
    label = f' role="img" aria-label="{html.escape(name)}" title="{html.escape(name)}"' if name else ""
    return f'<span class="mark m{i % 8}{own}"{label}>{MARKS[i % len(MARKS)]}</span>'


def _card_section(score: Score, others: Sequence[Score], protocol: ProtocolConfig) -> str:
    """The scorecard, a column for each controller."""
    everyone = [score, *others]
    head = ["figure", *(html.breakable(who.name) for who in everyone)]
    rows = []
    for name, figure in protocol.figures.items():
        cells = [_cell(figure_told(who.scorecard["figures"][name])) for who in everyone]
        rows.append([f'<th scope="row">{html.heading(figure.label)}</th>', *cells])
    late = [html.escape(timing_told(who)) for who in everyone]
    rows.append(['<th scope="row">ticks later than their period, on this machine</th>', *late])
    spent = [html.escape(tuning_told(who.scorecard["tuning"])) for who in everyone]
    rows.append(['<th scope="row">tuning budget spent</th>', *spent])
    told = (
        "Over runs with no axis changed; below each figure its 95 % interval. A run that did not come to its "
        "end counts as worse than any value: a dash says that more runs failed than the figure leaves out."
    )
    return html.section("scorecard", "Scorecard", html.table("scorecard", head, rows), html.paragraph(told))


def _cell(told: tuple[str, str]) -> str:
    value, beside = told
    return html.escape(value) + (f"<small>{html.escape(beside)}</small>" if beside else "")


def _origin_section(score: Score) -> str:
    """What it was made of: enough to make it again."""
    content = score.content
    seeds = content["seeds"]
    where = seeds["kind"] if not seeds["round"] else f"round {seeds['round']}, key {seeds['key']}"
    facts = [
        (
            "protocol",
            f"{content['protocol']}{' (draft)' if content['draft'] else ''}",
            content["protocol_sha256"],
        ),
        ("track and arms", f"{content['track']}; {', '.join(content['arms'])}", ""),
        ("seeds", where, ""),
        ("controller", score.name, content["controller"]["definition_sha256"]),
        ("scorecard", "hash of its content", content["scorecard_sha256"]),
        ("rows", f"{len(score.rows)} runs", content["rows_sha256"]),
        ("surgsim", f"{content['environment']['surgsim']}", str(content["environment"]["commit"] or "")),
    ]
    rows = [
        [
            f'<th scope="row">{html.escape(name)}</th>',
            f'{html.escape(text)} <span class="hash">{html.escape(sha)}</span>',
        ]
        for name, text, sha in facts
    ]
    return html.section("origin", "Where it comes from", html.table("origin", ["", ""], rows))
