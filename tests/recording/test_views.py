"""What the viewer shows first: signals without limits or legends, the tip inside, only what applies."""

from collections.abc import Iterator

import numpy as np
import pytest
import rerun.blueprint as rrb
from numpy.testing import assert_allclose

from surgsim.columns import scalar, vector
from surgsim.recording.blueprint import blueprint
from surgsim.recording.eyes import inside_view
from surgsim.recording.layout import LIMITS
from surgsim.recording.plots import groups, joint_plots
from surgsim.recording.scene import dashes, scenario_of
from surgsim.recording.signals import series_colors
from surgsim.recording.summary import result_markdown
from surgsim.recording.write import write_recording
from surgsim.trace.trace import Trace

HALF_ANGLE_DEG = 20.0  # well within the viewer's field of view
MEGABYTE = 1e6


def views(part: rrb.View | rrb.Container) -> Iterator[rrb.View]:
    if isinstance(part, rrb.View):
        yield part
    for child in getattr(part, "contents", ()) if isinstance(part, rrb.Container) else ():
        yield from views(child)


def laid_out(trace: Trace) -> list[rrb.View]:
    return [*views(blueprint(scenario_of(trace), trace).root_container)]


def with_blocks(trace: Trace, *added) -> Trace:
    """`trace` with more blocks, of which each column is a ramp of its own."""
    ramp = np.linspace(0.0, 1.0, len(trace))
    columns = [ramp + k for k in range(sum(len(block.columns) for block in added))]
    return Trace(np.column_stack([trace.data, *columns]), (*trace.blocks, *added), trace.meta)


def test_joints_are_scaled_to_their_data_and_limits_are_a_tab(trace: Trace) -> None:
    for tabs in joint_plots(trace):
        assert tabs.active_tab == 0
        assert [LIMITS in str(view.contents) for view in tabs.contents[:2]] == [False, True]
        assert tabs.contents[0].properties["PlotLegend"].visible.as_arrow_array().to_pylist() == [False]


def test_only_legends_with_room_beside_the_data_are_shown(trace: Trace) -> None:
    trace = with_blocks(trace, scalar("grip", "n"), vector("hand", "n"), scalar("tank", "j"))
    end = int(1e9 * trace["t_s"][-1])
    with_legend = []
    for view in laid_out(trace):
        legend = view.properties.get("PlotLegend")
        if legend is not None and legend.visible.as_arrow_array().to_pylist() == [True]:
            with_legend.append(view.name)
            shown = view.properties["TimeAxis"].view_range.as_arrow_array().to_pylist()[0]
            assert shown["end"] > 1.3 * end
    assert with_legend == ["Force [N]", "Energy [J]"]


def test_series_of_one_plot_take_different_colours(trace: Trace) -> None:
    trace = with_blocks(trace, scalar("grip", "n"), vector("hand", "n"), scalar("tank", "j"))
    colors = series_colors(trace)
    assert len({*colors["grip"], *colors["hand"]}) == 4
    assert len({*colors["q"]}) == 7


def test_what_never_changes_is_not_plotted(trace: Trace) -> None:
    constant = scalar("tank", "j")
    still = Trace(
        np.column_stack([trace.data, np.full(len(trace), 0.3)]), (*trace.blocks, constant), trace.meta
    )
    assert groups(still) == {}
    assert groups(with_blocks(trace, constant)) == {"j": [constant]}
    assert "Saturated joints" not in [view.name for view in laid_out(trace)]
    assert "of joint" in [view.name for view in laid_out(trace)]


def eye_of(view: rrb.Spatial3DView) -> tuple[np.ndarray, np.ndarray]:
    controls = view.properties["EyeControls3D"]
    position = np.array(controls.position.as_arrow_array().to_pylist()[0])
    return position, np.array(controls.look_target.as_arrow_array().to_pylist()[0])


@pytest.mark.parametrize("base", [(0.0, 0.0, 0.0), (0.3, 0.2, 0.1)])
def test_the_inner_eye_is_near_the_port_and_sees_the_whole_path(scenario, base) -> None:
    """Below the skin, a hand's breadth from the tip, with the path large in the middle of its view."""
    from surgsim.simulate.loop import simulate

    offset = np.array(base)
    shifted = [f"{key}={(offset + at).tolist()}" for key, at in PLACES.items()]
    run = simulate(scenario("theatre=true", f"robot.base_position_m={list(base)}", *shifted))
    view = inside_view(scenario_of(run), run)
    eye, target = eye_of(view)
    trocar = run.block("trocar")[0]
    assert eye[2] < trocar[2]
    assert np.linalg.norm(eye - trocar) < 0.25
    towards = run.block("tip_ref") - eye
    cosines = towards @ (target - eye) / np.linalg.norm(towards, axis=1) / np.linalg.norm(target - eye)
    assert np.rad2deg(np.arccos(cosines.min())) < HALF_ANGLE_DEG
    assert_allclose(np.ptp(run.block("tip_ref"), axis=0) / 2 + run.block("tip_ref").min(axis=0), target)
    assert "- /scene/patient/skin/**" in view.contents
    assert "- /scene/patient/lining/**" not in view.contents


PLACES = {"trocar.position_m": np.array([0.0, 0.55, 0.2]), "task.start_m": np.array([0.02, 0.55, 0.02])}


def test_a_path_that_is_a_point_is_seen(trace: Trace) -> None:
    data = trace.data.copy()
    first = trace.columns.index("tip_ref_x_m")
    data[:, first : first + 3] = (0.02, 0.55, 0.02)
    eye, target = eye_of(inside_view(scenario_of(trace), Trace(data, trace.blocks, trace.meta)))
    assert 0.02 < np.linalg.norm(eye - target) < 0.1


def test_a_run_without_any_reference_has_a_view(trace: Trace) -> None:
    data = trace.data.copy()
    first = trace.columns.index("tip_ref_x_m")
    data[:, first : first + 3] = np.nan
    eye, target = eye_of(inside_view(scenario_of(trace), Trace(data, trace.blocks, trace.meta)))
    assert np.isfinite([eye, target]).all()


def test_dashes_are_half_of_the_line() -> None:
    angle = np.linspace(0.0, 2 * np.pi, 2000)
    line = 0.02 * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    pieces = dashes(line)
    length = sum(np.linalg.norm(np.diff(piece, axis=0), axis=1).sum() for piece in pieces)
    assert length == pytest.approx(np.pi * 0.02, rel=0.05)
    assert len(pieces) > 10
    assert all(len(piece) > 1 for piece in pieces)


@pytest.mark.parametrize("line", [np.zeros((0, 3)), np.zeros((1, 3)), np.ones((50, 3))])
def test_a_line_without_length_is_one_dash(line: np.ndarray) -> None:
    (only,) = dashes(line)
    assert np.array_equal(only, line)


def test_metrics_that_do_not_apply_are_left_out(trace: Trace) -> None:
    text = result_markdown(trace.meta, {"tip_error_rms_mm": 0.125, "trocar_force_max_n": None, "sparc": -2.0})
    assert text.splitlines()[-3:] == ["|---|---|", "| tip_error_rms_mm | 0.125 |", "| sparc | -2 |"]
    assert "trocar_force_max_n" not in text


def test_two_runs_side_by_side_share_their_axes(trace: Trace) -> None:
    from surgsim.recording.side_by_side import common_axis

    axis = common_axis([np.array([0.0, 1.0, np.nan]), np.array([np.inf, 3.0])])
    assert_allclose(axis.range.as_arrow_array().to_pylist()[0], [-0.15, 3.15])
    assert common_axis([np.full(3, np.nan)]) is None


def test_twenty_smooth_seconds_fit_in_eight_megabytes(trace: Trace, tmp_path) -> None:
    t = 1e-3 * np.arange(20_001)
    speeds = np.linspace(0.3, 3.0, len(trace.columns))
    data = trace.data[0] + 0.1 * np.sin(np.outer(t, speeds))
    data[:, 0] = t
    path = tmp_path / "r.rrd"
    write_recording(path, Trace(data, trace.blocks, trace.meta), {})
    assert path.stat().st_size < 8 * MEGABYTE
