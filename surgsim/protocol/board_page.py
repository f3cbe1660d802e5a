"""The leaderboard's files: a page, the same as text, and a table for other tools."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from surgsim.errors import SurgsimError
from surgsim.protocol.definition import Protocol
from surgsim.protocol.passport_page import document
from surgsim.protocol.ranking import ordered, place_of
from surgsim.protocol.score import Score
from surgsim.protocol.score_text import figure_told, timing_told, tuning_told
from surgsim.recording.files import replacing, write_file
from surgsim.recording.folders import make_folder
from surgsim.report import html

_FIRST = ("place", "controller", "failed runs")


def write_board(out: Path, protocol: Protocol, found: Mapping[Path, Score]) -> None:
    """Write `index.html`, `README.md` and `table.csv` about the scores in their folders.

    Raises:
        SurgsimError: If the disk refuses.
    """
    tracks: dict[str, dict[Path, Score]] = {}
    for folder, made in found.items():
        tracks.setdefault(str(made.content["track"]), {})[folder] = made
    contents = {
        "index.html": _page(out, protocol, tracks),
        "README.md": _text(out, protocol, tracks),
        "table.csv": _table(protocol, list(found.values())),
    }
    try:
        make_folder(out)
        for name, content in contents.items():
            with replacing(out / name) as draft:
                write_file(draft, content)
    except OSError as error:
        raise SurgsimError(f"cannot write {out}: {error.strerror or error}") from error


def track_sentence(scores: Sequence[Score], protocol: Protocol) -> str:
    """Who comes furthest, and how many fail before anything is made harder."""
    best, places = ordered(scores, protocol.config), place_of(scores, protocol.config)
    first = [score.name for score in best if places[id(score)] == 1]
    figure = best[0].scorecard["figures"]["levels_held"]["value"]
    failing = sum(bool(score.scorecard["failures"]) for score in scores)
    held = "" if figure is None else f" with {100.0 * figure:.0f} % of all levels held"
    return (
        f"{', '.join(first)} {'comes' if len(first) == 1 else 'come'} furthest{held}; "
        f"{failing} of {len(scores)} controllers failed in some run."
    )


def _rows(protocol: Protocol, scores: Sequence[Score]) -> list[list[tuple[str, str]]]:
    """Cells of the table, the furthest first: what they say, and what stands beside it."""
    places = place_of(scores, protocol.config)
    return [
        [
            (str(places[id(score)]), ""),
            (score.name, ""),
            (f"{sum(score.scorecard['failures'].values())} of {score.scorecard['runs']}", ""),
            *(figure_told(score.scorecard["figures"][name]) for name in protocol.config.figures),
            (timing_told(score), ""),
            (tuning_told(score.scorecard["tuning"]), ""),
        ]
        for score in ordered(scores, protocol.config)
    ]


def _cell(told: tuple[str, str]) -> str:
    value, beside = told
    return html.escape(value) + (f"<small>{html.escape(beside)}</small>" if beside else "")


def _text_cell(told: tuple[str, str]) -> str:
    value, beside = told
    return f"{value} ({beside})" if beside else value


def _head(protocol: Protocol) -> list[str]:
    labels = [figure.label for figure in protocol.config.figures.values()]
    return [*_FIRST, *labels, "ticks later than their period", "tuning"]


def _page(out: Path, protocol: Protocol, tracks: Mapping[str, Mapping[Path, Score]]) -> str:
    some = next(iter(next(iter(tracks.values())).values()))
    lead = html.paragraph(
        f"{protocol.config.description}. Arms: {', '.join(some.content['arms'])}; seeds: {_seeds(some)}; "
        f"protocol {some.content['protocol_sha256'][:16]}."
    )
    if some.content["draft"]:
        lead += html.paragraph("The protocol is a draft: these are not yet scores of record.", "warning")
    body = "\n".join(_section(out, protocol, name, scores) for name, scores in tracks.items())
    return document(f"{protocol.name}: leaderboard", lead, body)


def _seeds(score: Score) -> str:
    seeds = score.content["seeds"]
    return f"round {seeds['round']}" if seeds["round"] else "development"


def _section(out: Path, protocol: Protocol, track: str, found: Mapping[Path, Score]) -> str:
    scores = list(found.values())
    places = {id(score): folder for folder, score in found.items()}
    rows = []
    for cells, score in zip(_rows(protocol, scores), ordered(scores, protocol.config), strict=True):
        link = (places[id(score)] / "passport.html").relative_to(out).as_posix()
        name = f'<th scope="row"><a href="{html.escape(link)}">{html.breakable(score.name)}</a></th>'
        rows.append([_cell(cells[0]), name, *map(_cell, cells[2:])])
    head = [html.heading(label) for label in _head(protocol)]
    return html.section(
        track,
        f"Track {track}",
        f'<p class="lead">{html.escape(track_sentence(scores, protocol))}</p>',
        html.paragraph(f"A controller may know: {protocol.config.tracks[track].description}."),
        html.table(track, head, rows),
    )


def _text(out: Path, protocol: Protocol, tracks: Mapping[str, Mapping[Path, Score]]) -> str:
    lines = [
        f"# {protocol.name}: leaderboard",
        "",
        "Made by `surgsim score --all`. Names lead to passports; docs/protocol.md says how to read them.",
    ]
    head = _head(protocol)
    for track, found in tracks.items():
        scores = list(found.values())
        places = {id(score): folder.relative_to(out).as_posix() for folder, score in found.items()}
        lines += ["", f"## Track {track}", "", track_sentence(scores, protocol), ""]
        lines += [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
        for cells, score in zip(_rows(protocol, scores), ordered(scores, protocol.config), strict=True):
            name = f"[`{score.name}`]({places[id(score)]}/passport.html)"
            texts = [_text_cell(cells[0]), name, *map(_text_cell, cells[2:])]
            lines.append(f"| {' | '.join(texts)} |")
    return "\n".join(lines) + "\n"


def _table(protocol: Protocol, scores: Sequence[Score]) -> str:
    """A row for each score, figures and their intervals in columns of their own."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    figures = [f"{name}{end}" for name in protocol.config.figures for end in ("", "_low", "_high")]
    writer.writerow(["track", "controller", "runs", "failed", *figures, "tuning_runs", "scorecard_sha256"])
    for score in scores:
        card = score.scorecard
        values = [
            card["figures"][name][key] for name in protocol.config.figures for key in ("value", "low", "high")
        ]
        failed = sum(card["failures"].values())
        ends = [card["tuning"]["runs"], score.content["scorecard_sha256"]]
        writer.writerow([card["track"], score.name, card["runs"], failed, *values, *ends])
    return text.getvalue()
