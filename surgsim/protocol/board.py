"""The leaderboard: every entry of a protocol's tracks, its score and passport, and a page about all."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path

from surgsim.compare.workers import kept_workers, run_jobs
from surgsim.protocol.board_page import write_board
from surgsim.protocol.definition import Protocol, entry_file, entry_label, entry_scheme
from surgsim.protocol.entrants import entrant
from surgsim.protocol.passport_files import write_passport
from surgsim.protocol.reading import baselines_of
from surgsim.protocol.runs import Report
from surgsim.protocol.score import Means, Score, Wish, check_out, score, write_score
from surgsim.protocol.seeds import Seeds

Progress = Callable[[str], AbstractContextManager[Report]]


@dataclass(frozen=True, kw_only=True)
class Board:
    """A leaderboard that is to be made.

    Attributes:
        protocol: The protocol.
        tracks: Its tracks that are wanted.
        arms: Robots.
        seeds: Where seeds come from.
        out: Its folder: a folder for each track, in it one for each entry.
    """

    protocol: Protocol
    tracks: tuple[str, ...]
    arms: tuple[str, ...]
    seeds: Seeds
    out: Path

    def folder(self, track: str, entry: str) -> Path:
        """The folder of an entry's score."""
        return self.out / track / entry_label(entry)


def make_board(
    board: Board, means: Means, progress: Progress, tell: Callable[[str], object]
) -> list[Score] | None:
    """Score every entry and write the page; what the store holds is not run again.

    Args:
        board: What is wanted.
        means: How runs are done.
        progress: Gives a report of progress under a label.
        tell: Called with a line after each entry.

    Returns:
        The scores; None while runs of other shards are missing.

    Raises:
        SurgsimError: If the protocol changed, or runs cannot be done.
    """
    wishes = {
        board.folder(track, entry): Wish(
            protocol=board.protocol,
            track=track,
            arms=board.arms,
            seeds=board.seeds,
            entrant=entrant(entry_file(entry), label=entry_label(entry), scheme=entry_scheme(entry)),
        )
        for track in board.tracks
        for entry in board.protocol.track(track).entries
    }
    for folder in wishes:
        check_out(folder, resume=True)
    found: dict[Path, Score] = {}
    missing = False
    with kept_workers(means.jobs) as keep:
        held = means if means.runner is not run_jobs else replace(means, runner=lambda jobs, _: keep(jobs))
        for number, (folder, wish) in enumerate(wishes.items(), start=1):
            with progress(f"{number}/{len(wishes)} {wish.track}, {folder.name}") as report:
                made = score(wish, held, report)
            missing = missing or made is None
            if made is not None:
                write_score(folder, made)
                found[folder] = made
                tell(f"{number} of {len(wishes)}: {folder}")
    if missing:
        return None
    if left_out := _write_passports(board, found):
        tell(left_out)
    write_board(board.out, board.protocol, found)
    return list(found.values())


def _write_passports(board: Board, found: dict[Path, Score]) -> str:
    """Each passport beside the baselines of its track; no picture, which is half a megabyte each.

    Returns:
        Why they have no chart, in a line; empty if they have.
    """
    left_out = ""
    for folder, made in found.items():
        beside = baselines_of(made, found.values(), board.protocol)
        left_out = write_passport(folder, made, beside, board.protocol.config, drawn=(".pdf",))
    return left_out
