"""A recorded run as pictures: its scene, its cameras, and where everything was at a row of the trace."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.errors import SurgsimError, unknown_name
from surgsim.models.drawing import Drawing, FixedCamera, Line, Picture
from surgsim.recording import palette
from surgsim.recording.eyes import COVERS, inside_eye
from surgsim.recording.polyline import drawn_rows
from surgsim.recording.replay import Replay
from surgsim.recording.scene import rebuild_all, scenario_of
from surgsim.trace.trace import Trace

CAMERAS = {
    "overview": "the theatre",
    "port_closeup": "the port, from outside",
    "inside": "the path in the patient, from a place below the port",
    "endoscope": "from beside the shaft past the tip; it moves with the tip",
    "lens": "what an endoscope that an arm holds sees",
}
"""Cameras by name, and what each sees."""

LENS = "lens"
"""Name of an endoscope's camera in its file."""
_THROUGH = ("inside", "endoscope", "lens")
"""Cameras for which what covers the patient is left out."""

_ENDOSCOPE_M = np.array([0.0, 0.030, -0.075])  # from the tip, z along the shaft
_ENDOSCOPE_TARGET_M = np.array([0.0, 0.0, 0.012])
_ENDOSCOPE_DEG, _INSIDE_DEG = 55.0, 45.0
_MOST_PIECES = 400
_LIFT = 0.004
_COMMANDED = np.array([*palette.SKY, 255]) / 255.0
_TRAVELLED = np.array([*palette.BLACK, 255]) / 255.0


def check_cameras(names: Sequence[str]) -> None:
    """Refuse a name that is no camera's.

    Raises:
        SurgsimError: If there is one.
    """
    for name in names:
        if name not in CAMERAS:
            raise SurgsimError(f"--camera: {unknown_name(name, 'camera', CAMERAS)}")


class Replayed:
    """A run that is looked at; made by `replayed`.

    Args:
        trace: The run.
        replay: Puts its scene where it was.
        drawing: Draws it.
        names: Names of the arms' cameras in the model, by what they are called here.
    """

    def __init__(self, trace: Trace, replay: Replay, drawing: Drawing, names: Mapping[str, str]) -> None:
        self.trace = trace
        self._replay, self._drawing, self._names = replay, drawing, names
        every = np.arange(len(trace))
        self._commanded = [_line(one.block("tip_ref"), every, _COMMANDED, 3.0) for one in trace.each()]
        self._tips = [one.block("tip") for one in trace.each()]
        self._rows = [_path_rows(tip) for tip in self._tips]

    def picture(self, row: int, camera: str, *, paths: bool = True) -> Picture:
        """What a camera saw at a row of the trace, with the path commanded and that travelled so far."""
        self._replay.place(row)
        self._replay.aim()
        hidden = COVERS if camera in _THROUGH else ()
        name = self._names.get(camera, camera)
        if camera == LENS and LENS not in self._names:
            raise SurgsimError("camera 'lens': no arm of the run holds an endoscope")
        return self._drawing.picture(
            self._replay.data, name, hidden, self._lines(row, camera) if paths else ()
        )

    def _lines(self, row: int, camera: str) -> list[Line]:
        if camera == "overview":  # the patient is before them
            return []
        travelled = [
            _line(tip, np.append(rows[rows < row], row), _TRAVELLED, 1.5, _LIFT)
            for tip, rows in zip(self._tips, self._rows, strict=True)
        ]
        return [*self._commanded, *travelled]


@contextmanager
def replayed(trace: Trace, width: int, height: int) -> Iterator[Replayed]:
    """A run in its theatre, whether or not it was simulated in one, to be drawn in this size.

    Raises:
        SurgsimError: If its scene cannot be built here, or this machine cannot draw.
    """
    scenario = scenario_of(trace)
    eye, target = inside_eye(scenario, trace)
    cameras = (
        FixedCamera(name="inside", position=eye, target=target, fovy_deg=_INSIDE_DEG),
        FixedCamera(
            name="endoscope",
            position=_ENDOSCOPE_M,
            target=_ENDOSCOPE_TARGET_M,
            fovy_deg=_ENDOSCOPE_DEG,
            on_tip=True,
        ),
    )
    scenes = rebuild_all(scenario, theatre=True, cameras=cameras)
    with Drawing(scenes[0].model, width, height) as drawing:
        names = {camera.name: scenes[0].prefix + camera.name for camera in cameras}
        lenses = [s.prefix + LENS for s in scenes if s.parts.has_camera(LENS)]
        names |= {LENS: lenses[0]} if lenses else {}
        yield Replayed(trace, Replay(scenes, trace), drawing, names)


def _path_rows(points: Array) -> NDArray[np.intp]:
    """Rows through which a path (rows, 3) is drawn."""
    rows = drawn_rows(points)
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), _MOST_PIECES)).astype(np.intp))]


def _line(points: Array, rows: NDArray[np.intp], rgba: Array, width: float, lift: float = 0.0) -> Line:
    """A path through these rows, or through fewer."""
    shown = points[rows]
    shown = shown[np.isfinite(shown).all(axis=1)]
    if len(shown) > _MOST_PIECES:
        shown = shown[_path_rows(shown)]
    return Line(points=shown, rgba=rgba, width=width, lift=lift)
