"""How the viewer lays a recording out: the scene on the left, the signals on the right."""

import numpy as np
import rerun.blueprint as rrb

from surgsim.recording.layout import ERRORS, LIMITS, LOG, SCENE, SUMMARY, TIMELINE, series_path
from surgsim.recording.scene import RCM_ARROW_SCALE
from surgsim.scenario.schema import Scenario
from surgsim.trace.trace import BASE_BLOCKS, Array, Trace

# Eye from the focus [m]; x points from the robot's base to the trocar, y to its left.
_EYE_M = np.array([-0.38, -0.93, 0.58])
_BACKGROUND = (52, 60, 66)


def blueprint(scenario: Scenario, trace: Trace) -> rrb.Blueprint:
    """The layout that is stored in the file."""
    left = rrb.Vertical(scene_view(scenario, trace), texts_view(), row_shares=[0.72, 0.28])
    middle = rrb.Vertical(
        plot("Tip and RCM error [mm]", ERRORS),
        _tabs(
            plot("Manipulability", series_path("manipulability")),
            plot("6-D", series_path("manipulability_6d")),
        ),
        _tabs(
            _control_time_plot(trace),
            plot("Resolver residual [m/s]", series_path("resolver_residual")),
            plot("Saturated joints", series_path("saturated_joints")),
        ),
    )
    right = rrb.Vertical(
        _tabs(
            plot("Joint position [rad], limits grey", series_path("q"), f"{LIMITS}/q"),
            plot("Reference", series_path("q_ref"), f"{LIMITS}/q"),
        ),
        _tabs(
            plot("Joint velocity [rad/s], limits grey", series_path("v"), f"{LIMITS}/v"),
            plot("Command", series_path("qdot_ref"), f"{LIMITS}/v"),
        ),
        _tabs(plot("Torque [N m], limits grey", series_path("tau"), f"{LIMITS}/tau"), *_terms(trace)),
    )
    return rrb.Blueprint(
        rrb.Horizontal(left, middle, right, column_shares=[0.46, 0.26, 0.28]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
    )


def scene_view(
    scenario: Scenario, trace: Trace, *, below: str = "", name: str | None = None
) -> rrb.Spatial3DView:
    """The 3-D view of the scene below entity `below`, its eye on arm and port."""
    focus = _focus(scenario, trace)
    base = np.array(scenario.robot.base_position_m)
    away = (focus - base)[:2]
    ahead = away / np.linalg.norm(away) if np.linalg.norm(away) > 1e-6 else np.array([1.0, 0.0])
    eye = np.array(
        [ahead[0] * _EYE_M[0] - ahead[1] * _EYE_M[1], ahead[1] * _EYE_M[0] + ahead[0] * _EYE_M[1], 0.0]
    )
    eye[2] = _EYE_M[2]
    target = focus + 0.25 * (base - focus) + np.array([0.0, 0.0, 0.15])
    return rrb.Spatial3DView(
        name=name or f"Tip path: desired blue, actual red. RCM error x{RCM_ARROW_SCALE:g}: yellow arrow",
        origin=f"/{below}{SCENE}",
        background=_BACKGROUND,
        line_grid=not scenario.theatre,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=focus + eye, look_target=target, eye_up=(0.0, 0.0, 1.0)
        ),
    )


def _focus(scenario: Scenario, trace: Trace) -> Array:
    if scenario.trocar is not None:
        return np.array(scenario.trocar.position_m)
    return np.array(trace.block("tip")[0])


def texts_view(below: str = "") -> rrb.Tabs:
    """Result, scenario and log below entity `below`, as tabs."""
    return _tabs(
        rrb.TextDocumentView(name="Result", origin=f"/{below}{SUMMARY}/result"),
        rrb.TextDocumentView(name="Scenario", origin=f"/{below}{SUMMARY}/scenario"),
        rrb.TextLogView(name="Log", origin=f"/{below}{LOG}"),
    )


def _tabs(*views: rrb.View) -> rrb.Tabs:
    return rrb.Tabs(*views, active_tab=0)


def _terms(trace: Trace) -> list[rrb.TimeSeriesView]:
    """A plot for every term of the torque law."""
    terms = trace.blocks[len(BASE_BLOCKS) :]
    return [plot(block.name.strip("_").removeprefix("tau_"), series_path(block.name)) for block in terms]


def _control_time_plot(trace: Trace) -> rrb.TimeSeriesView:
    """Scaled to the deadline, not to the one slow first tick."""
    times = trace["control_time_s"]
    usual = float(np.quantile(times[np.isfinite(times)], 0.99)) if np.isfinite(times).any() else 0.0
    top = 1.2 * max(trace.meta.control_period_s, usual)
    axis = rrb.ScalarAxis(range=(0.0, top))
    return plot(
        "Control time [s], deadline grey", series_path("control_time"), f"{LIMITS}/control_time", axis_y=axis
    )


def plot(name: str, *paths: str, axis_y: rrb.ScalarAxis | None = None) -> rrb.TimeSeriesView:
    """A plot of the series at `paths`."""
    return rrb.TimeSeriesView(
        name=name,
        origin="/",
        contents=[f"+ /{path}" for path in paths],
        axis_y=axis_y,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
    )
