"""The 3-D views of a recording: the arm over the patient, and the tip inside it."""

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from surgsim.recording.layout import SCENE
from surgsim.recording.scene import ACTUAL_PATH, DESIRED_PATH, RCM_ARROW_SCALE
from surgsim.scenario.schema import Scenario
from surgsim.spatial import unit
from surgsim.trace.trace import Array, Trace

# Eye from the focus [m]; x points from the robot's base to the trocar, y to its left.
_EYE_M = np.array([-0.38, -0.93, 0.58])
_ASIDE = np.array([-0.45, -0.95, 0.0])  # of the inner eye from the shaft, in the same axes
_BACKGROUND = (132, 142, 148)
_SMALLEST_PATH_M = 0.012
_PATH_RADII = 3.4  # distance of the inner eye from the path's middle
_STEEPNESS = 1.1  # of the inner eye's look, along the shaft over across it
COVERS = ("abdomen", "skin", "drape", "cap")
"""Materials of the patient that the inner eye looks through."""


def scene_view(
    scenario: Scenario, trace: Trace, *, below: str = "", name: str | None = None
) -> rrb.Spatial3DView:
    """The 3-D view of the scene below entity `below`, its eye on arm and port."""
    focus, base = _focus(scenario, trace), np.array(scenario.robot.base_position_m)
    target = focus + 0.25 * (base - focus) + np.array([0.0, 0.0, 0.15])
    return rrb.Spatial3DView(
        name=name or f"Arm and port, RCM error x{RCM_ARROW_SCALE:g}: yellow arrow",
        origin=f"/{below}{SCENE}",
        background=_BACKGROUND,
        line_grid=not scenario.theatre,
        eye_controls=_eye(focus + _from_base(scenario, focus, _EYE_M), target),
    )


def inside_view(scenario: Scenario, trace: Trace, *, below: str = "") -> rrb.Spatial3DView:
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
            f"{scene}/{DESIRED_PATH}": rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(3.5)),
            f"{scene}/{ACTUAL_PATH}": rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(1.5)),
        },
    )


def inside_eye(scenario: Scenario, trace: Trace) -> tuple[Array, Array]:
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


def _from_base(scenario: Scenario, focus: Array, offset: Array) -> Array:
    """`offset` (3,) [m] of the axes base to `focus`, its left, and up, in the world."""
    away = (focus - np.array(scenario.robot.base_position_m))[:2]
    x, y = away / np.linalg.norm(away) if np.linalg.norm(away) > 1e-6 else (1.0, 0.0)
    return np.array([x * offset[0] - y * offset[1], y * offset[0] + x * offset[1], offset[2]])


def _focus(scenario: Scenario, trace: Trace) -> Array:
    if scenario.trocar is not None:
        return np.array(scenario.trocar.position_m)
    return np.array(trace.block("tip")[0])


def _path(trace: Trace) -> tuple[Array, float]:
    """Middle (3,) [m] of the tip's desired path and its radius [m], never too small to be seen."""
    points = trace.block("tip_ref")
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        points = np.nan_to_num(trace.block("tip")[:1])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = float(np.linalg.norm(points - middle, axis=1).max())
    return middle, max(radius, _SMALLEST_PATH_M)
