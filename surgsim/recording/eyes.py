"""The 3-D views of a recording: the arm over the patient, and the tip inside it."""

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from surgsim.array import Array
from surgsim.recording.layout import SCENE
from surgsim.recording.scene import ACTUAL_PATH, DESIRED_PATH, RCM_ARROW_SCALE
from surgsim.scenario.arms import Experiment, each_arm
from surgsim.spatial import unit
from surgsim.trace.trace import Trace

# Eye from the focus [m]; x points from the robot's base to the trocar, y to its left.
_EYE_M = np.array([-0.38, -0.93, 0.58])
_FARTHER = 1.5  # where there are several arms, around the port
_ASIDE = np.array([-0.45, -0.95, 0.0])  # of the inner eye from the shaft, in the same axes
_BACKGROUND = (132, 142, 148)
_SMALLEST_PATH_M = 0.012
_PATH_RADII = 3.4  # distance of the inner eye from the path's middle
_STEEPNESS = 1.1  # of the inner eye's look, along the shaft over across it
COVERS = ("abdomen", "skin", "drape", "cap")
"""Materials of the patient that the inner eye looks through."""


def scene_view(
    scenario: Experiment, trace: Trace, *, below: str = "", name: str | None = None
) -> rrb.Spatial3DView:
    """The 3-D view of the scene below entity `below`, its eye on arm and port."""
    focus, base = _focus(scenario, trace), _base(scenario)
    away, aside = (_FARTHER, 0.0) if trace.arms else (1.0, 0.25)
    target = focus + aside * (base - focus) + np.array([0.0, 0.0, 0.15])
    return rrb.Spatial3DView(
        name=name or f"Arm and port, RCM error x{RCM_ARROW_SCALE:g}: yellow arrow",
        origin=f"/{below}{SCENE}",
        background=_BACKGROUND,
        line_grid=not scenario.theatre,
        eye_controls=_eye(focus + _from_base(scenario, focus, away * _EYE_M), target),
    )


def inside_view(scenario: Experiment, trace: Trace, *, below: str = "") -> rrb.Spatial3DView:
    """The same scene from within the patient: an eye beside the shaft, below the port, on the tip's path.

    What covers the patient is left out, so that it hides nothing should the eye be above it.
    """
    scene = f"/{below}{SCENE}"
    eye, middle = inside_eye(scenario, trace)
    return rrb.Spatial3DView(
        name="Inside. Path: desired blue, actual black",
        origin=scene,
        contents=[f"+ {scene}/**", *(f"- {scene}/patient/{cover}/**" for cover in COVERS)],
        background=_BACKGROUND,
        line_grid=not scenario.theatre,
        eye_controls=_eye(eye, middle),
        overrides={
            f"{scene}/{of}{path}": rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(points))
            for of in ([f"{arm}/" for arm in trace.arms] or [""])
            for path, points in ((DESIRED_PATH, 3.5), (ACTUAL_PATH, 1.5))
        },
    )


def inside_eye(scenario: Experiment, trace: Trace) -> tuple[Array, Array]:
    """Where the inner eye is (3,) [m], and the middle of the path (3,) [m], at which it looks."""
    middle, radius = _path(trace)
    up = _focus(scenario, trace) - middle
    up = unit(up) if np.linalg.norm(up) > 1e-6 else np.array([0.0, 0.0, 1.0])
    aside = unit(_from_base(scenario, middle, _ASIDE))
    return middle + _PATH_RADII * radius * unit(_STEEPNESS * up + aside), middle


def _eye(position: Array, target: Array) -> rrb.EyeControls3D:
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=position, look_target=target, eye_up=(0.0, 0.0, 1.0)
    )


def _from_base(scenario: Experiment, focus: Array, offset: Array) -> Array:
    """`offset` (3,) [m] of the axes base to `focus`, its left, and up, in the world."""
    away = (focus - _base(scenario))[:2]
    x, y = away / np.linalg.norm(away) if np.linalg.norm(away) > 1e-6 else (1.0, 0.0)
    return np.array([x * offset[0] - y * offset[1], y * offset[0] + x * offset[1], offset[2]])


def _focus(scenario: Experiment, trace: Trace) -> Array:
    """The first port, or where the first tip begins (3,) [m]."""
    ports = [one.trocar.position_m for one in each_arm(scenario) if one.trocar is not None]
    return np.array(ports[0] if ports else trace.each()[0].block("tip")[0])


def _base(scenario: Experiment) -> Array:
    """The base of the first arm (3,) [m]."""
    return np.array(each_arm(scenario)[0].robot.base_position_m)


def _path(trace: Trace) -> tuple[Array, float]:
    """Middle (3,) [m] of the tips' desired paths and their radius [m], never too small to be seen."""
    points = np.vstack([one.block("tip_ref") for one in trace.each()])
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        points = np.nan_to_num(trace.each()[0].block("tip")[:1])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = float(np.linalg.norm(points - middle, axis=1).max())
    return middle, max(radius, _SMALLEST_PATH_M)
