"""How the viewer lays a recording out: the scene on the left, the signals on the right."""

from collections.abc import Sequence

import rerun.blueprint as rrb

from surgsim.recording.eyes import inside_view, scene_view
from surgsim.recording.layout import LOG, SUMMARY, TIMELINE
from surgsim.recording.plots import added_plots, controller_plots, errors_plot, joint_key, joint_plots
from surgsim.scenario.arms import Experiment
from surgsim.trace.trace import Trace


def blueprint(scenario: Experiment, trace: Trace, until_s: float | None = None) -> rrb.Blueprint:
    """The layout that is stored in the file; of a run that goes on until `until_s` [s], by its beginning."""
    left = rrb.Vertical(scene_view(scenario, trace), inside_view(scenario, trace), row_shares=[0.55, 0.45])
    if trace.arms:
        columns = [_arm_column(arm, trace.of(arm)) for arm in trace.arms]
        right = rrb.Vertical(rrb.Horizontal(*columns), texts_view(), row_shares=[0.75, 0.25])
        return laid_out(rrb.Horizontal(left, right, column_shares=[0.42, 0.58]))
    middle = rrb.Vertical(
        errors_plot(),
        rrb.Tabs(*controller_plots(trace), active_tab=0),
        *tabs_of(added_plots(trace, until_s)),
        texts_view(),
    )
    right = rrb.Vertical(*joint_plots(trace), joint_key(trace.joints), row_shares=[0.31, 0.31, 0.31, 0.07])
    return laid_out(rrb.Horizontal(left, middle, right, column_shares=[0.4, 0.31, 0.29]))


def _arm_column(arm: str, trace: Trace) -> rrb.Vertical:
    """The signals of one of several arms."""
    below = f"{arm}/"
    return rrb.Vertical(
        errors_plot(below, name=f"{arm}: tip blue, RCM orange [mm]"),
        *joint_plots(trace, below),
        joint_key(trace.joints, below),
        row_shares=[0.24, 0.23, 0.23, 0.23, 0.07],
        name=arm,
    )


def laid_out(contents: rrb.Container) -> rrb.Blueprint:
    """A layout with its panels out of the way."""
    return rrb.Blueprint(
        contents,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
    )


def tabs_of(views: Sequence[rrb.View]) -> list[rrb.Tabs]:
    """The views as tabs; nothing if there are none."""
    return [rrb.Tabs(*views, active_tab=0)] if views else []


def texts_view(below: str = "") -> rrb.Tabs:
    """Result, scenario and log below entity `below`, as tabs."""
    return rrb.Tabs(
        rrb.TextDocumentView(name="Result", origin=f"/{below}{SUMMARY}/result"),
        rrb.TextDocumentView(name="Scenario", origin=f"/{below}{SUMMARY}/scenario"),
        rrb.TextLogView(name="Log", origin=f"/{below}{LOG}"),
        active_tab=0,
    )
