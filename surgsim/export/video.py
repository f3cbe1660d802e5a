"""Videos of recorded runs: several cameras or several runs side by side, in step."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surgsim.array import Array
from surgsim.errors import SurgsimError
from surgsim.export.labels import told_apart
from surgsim.export.moving import SUFFIXES, film, period_of
from surgsim.export.overlay import figures, written
from surgsim.export.replayed import Replayed, replayed
from surgsim.export.subjects import RunSubject, Subject
from surgsim.models.drawing import Picture
from surgsim.recording.files import replacing

__all__ = ["SUFFIXES", "VideoSettings", "write_video"]

Progress = Callable[[int, int], None]
"""Called with how many pictures are drawn, of how many."""

MOST_RUNS = 6
DEFAULT_FPS = {".mp4": 25.0, ".gif": 10.0}
DEFAULT_SIZE = {".mp4": (1280, 720), ".gif": (480, 270)}
_SMALLEST, _LARGEST = 32, 4096
_ASPECT = 1.5  # of a panel that shows most


@dataclass(frozen=True, kw_only=True)
class VideoSettings:
    """How a video is made.

    Attributes:
        cameras: Names of cameras, see `replayed.CAMERAS`.
        speed: Time of the run over time of the video.
        fps: Pictures a second; None: 25 for `.mp4`, 10 for `.gif`.
        size: Width and height of the whole video [pixels]; None: 1280 x 720, of a `.gif` 480 x 270.
    """

    cameras: tuple[str, ...] = ("overview",)
    speed: float = 1.0
    fps: float | None = None
    size: tuple[int, int] | None = None

    def size_of(self, path: Path) -> tuple[int, int]:
        """Width and height of the video in a file."""
        return self.size or DEFAULT_SIZE[path.suffix.lower()]

    def period_s(self, path: Path) -> float:
        """Time from picture to picture [s]."""
        return period_of(path, self.fps or DEFAULT_FPS[path.suffix.lower()])


def parse_size(text: str) -> tuple[int, int]:
    """Width and height of `WIDTHxHEIGHT`, both even, as videos need them.

    Raises:
        SurgsimError: If it is something else.
    """
    parts = text.lower().split("x")
    if len(parts) == 2 and all(part.isascii() and part.isdigit() and len(part) < 6 for part in parts):
        width, height = int(parts[0]), int(parts[1])
        if all(_SMALLEST <= side <= _LARGEST and side % 2 == 0 for side in (width, height)):
            return width, height
    raise SurgsimError(
        f"--size: '{text[:40]}' is not WIDTHxHEIGHT in even numbers of pixels from {_SMALLEST} to {_LARGEST}"
    )


def check_runs(subjects: Sequence[Subject]) -> list[RunSubject]:
    """The subjects, which are runs.

    Raises:
        SurgsimError: If they are something else, or too many.
    """
    runs = [subject for subject in subjects if isinstance(subject, RunSubject)]
    if len(runs) < len(subjects):
        raise SurgsimError("--video is of runs; --run RUN_ID takes some out of a batch")
    if len(runs) > MOST_RUNS:
        raise SurgsimError(f"--video: {len(runs)} runs are more than the {MOST_RUNS} that fit side by side")
    return runs


def write_video(
    path: Path, subjects: Sequence[Subject], settings: VideoSettings, progress: Progress | None = None
) -> None:
    """Draw every picture and write the video.

    Args:
        path: `.mp4` or `.gif`.
        subjects: Runs.
        settings: How.
        progress: Told of every picture.

    Raises:
        SurgsimError: If a run was not recorded, this machine cannot draw, or the disk refuses.
    """
    runs = check_runs(subjects)
    traces = [run.trace for run in runs]
    end_s = max(float(trace["t_s"][-1]) for trace in traces)
    times = picture_times(end_s, settings.speed * settings.period_s(path))
    width, height = settings.size_of(path)
    columns, rows = grid_of(len(runs), len(settings.cameras), (width, height))
    panel = (width // columns // 2 * 2, height // rows // 2 * 2)
    whole = (panel[0] * columns, panel[1] * rows)
    with ExitStack() as stack:
        shown = [stack.enter_context(replayed(trace, *panel)) for trace in traces]
        draft = stack.enter_context(replacing(path))
        taking = stack.enter_context(film(draft, path.suffix.lower(), settings.period_s(path), whole))
        for count, time_s in enumerate(times, start=1):
            panels = list(_panels(runs, shown, settings.cameras, float(time_s)))
            taking.add(side_by_side(panels, columns))
            if progress:
                progress(count, len(times))


def picture_times(end_s: float, step_s: float) -> Array:
    """Times of the run that are shown (n,) [s]: every `step_s` from 0 on, and its end."""
    count = int(end_s / step_s + 1e-9) + 1
    times = [step_s * k for k in range(count)]
    if end_s - times[-1] > 1e-9 * max(1.0, end_s):
        times.append(end_s)
    return np.array(times)


def grid_of(runs: int, cameras: int, size: tuple[int, int]) -> tuple[int, int]:
    """Columns and rows of panels: a run has a column and a camera a row; of one kind alone what fits best."""
    if runs > 1 and cameras > 1:
        return runs, cameras
    count = max(runs, cameras)

    def unlike(columns: int) -> float:
        rows = -(-count // columns)
        return abs(math.log(size[0] / columns / (size[1] / rows) / _ASPECT))

    columns = min(range(1, count + 1), key=unlike)
    return columns, -(-count // columns)


def _panels(
    runs: Sequence[RunSubject], shown: Sequence[Replayed], cameras: Sequence[str], time_s: float
) -> Iterator[Picture]:
    """Pictures at a time of the runs, camera by camera; a run that has ended stays at its last row."""
    names = told_apart(runs)
    for camera in cameras:
        for run, name, look in zip(runs, names, shown, strict=True):
            row = row_at(run.trace["t_s"], time_s)
            ended = row == len(run.trace) - 1 and run.outcome != "completed"
            head = f"{name}: {run.outcome.replace('_', ' ')}" if ended else name
            note = camera.replace("_", " ") if len(cameras) > 1 else ""
            yield written(look.picture(row, camera), head, figures(run.trace, row), note)


def row_at(t_s: Array, time_s: float) -> int:
    """The last row that is not later than a time, within a microsecond."""
    return max(0, int(np.searchsorted(t_s, time_s + 1e-6, side="right")) - 1)


def side_by_side(panels: Sequence[Picture], columns: int) -> Picture:
    """Panels of one size, row by row; what is left of the last row is dark."""
    rows = [list(panels[first : first + columns]) for first in range(0, len(panels), columns)]
    rows[-1] += [np.zeros_like(panels[0])] * (columns - len(rows[-1]))
    return np.vstack([np.hstack(row) for row in rows])
