"""Videos: what is shown when, by which camera, and in what file. Few pictures, small ones."""

import os
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image, ImageSequence

from surgsim.errors import Outcome, SurgsimError
from surgsim.export.moving import period_of
from surgsim.export.overlay import figures, written
from surgsim.export.replayed import replayed
from surgsim.export.video import (
    VideoSettings,
    grid_of,
    parse_size,
    picture_times,
    row_at,
    side_by_side,
    write_video,
)
from surgsim.models.drawing import widened
from surgsim.recording.eyes import COVERS
from surgsim.runs.stop import Stopped


@pytest.fixture
def look(run, blind):
    with replayed(run.trace, 96, 64) as found:
        yield found


def test_arm_and_tip_are_where_the_recording_has_them(run, look):
    for row in (0, len(run.trace) // 2, len(run.trace) - 1):
        look.picture(row, "overview")
        data, model = look._replay.data, look._drawing._model
        assert data.site_xpos[model.site("tip").id] == pytest.approx(run.trace.block("tip")[row], abs=1e-9)
        assert data.site_xpos[model.site("trocar").id] == pytest.approx(
            run.trace.block("trocar")[row], abs=1e-9
        )


def test_the_endoscope_looks_past_the_tip_and_moves_with_it(run, look):
    places = []
    for row in (0, len(run.trace) - 1):
        look.picture(row, "endoscope")
        data, model = look._replay.data, look._drawing._model
        camera = model.camera("endoscope").id
        shaft = run.trace.block("tip")[row] - run.trace.block("wrist")[row]
        shaft /= np.linalg.norm(shaft)
        to_tip = run.trace.block("tip")[row] - data.cam_xpos[camera]
        assert to_tip @ shaft == pytest.approx(0.075, abs=1e-3)  # behind the tip, along the shaft
        assert np.linalg.norm(to_tip - (to_tip @ shaft) * shaft) == pytest.approx(
            0.030, abs=1e-3
        )  # beside it
        forward = -data.cam_xmat[camera].reshape(3, 3)[:, 2]
        assert forward @ shaft > 0.9
        places.append(data.cam_xpos[camera].copy())
    moved = run.trace.block("tip")[-1] - run.trace.block("tip")[0]
    assert places[1] - places[0] == pytest.approx(moved, abs=1e-3)


def test_the_inner_eye_looks_at_the_path_through_what_covers_the_patient(run, look, blind):
    look.picture(0, "overview")
    look.picture(0, "inside")
    renderer, model = blind[0][0], look._drawing._model
    covers = [i for i in range(model.nmat) if model.mat(i).name.split("/")[-1] in COVERS]
    assert len(covers) == len(COVERS)
    assert (model.mat_rgba[covers, 3] > 0.0).all()  # as before
    covering = sum(model.geom_matid[geom] in covers for geom in range(model.ngeom))
    (_, _, _, whole, _), (_, _, _, open_, _) = blind
    assert whole - open_ == covering
    middle = (run.trace.block("tip_ref").min(axis=0) + run.trace.block("tip_ref").max(axis=0)) / 2
    camera = model.camera("inside").id
    forward = -look._replay.data.cam_xmat[camera].reshape(3, 3)[:, 2]
    to_path = middle - look._replay.data.cam_xpos[camera]
    assert forward == pytest.approx(to_path / np.linalg.norm(to_path), abs=1e-6)
    assert renderer._scene_option.geomgroup[3] == 0  # collision shapes stay hidden


def test_the_path_is_drawn_as_far_as_it_was_travelled(look, blind, run):
    last = len(run.trace) - 1
    for row, camera in ((0, "inside"), (last // 2, "inside"), (last, "inside"), (last, "overview")):
        look.picture(row, camera)
    start, half, whole, overview = (drawn - before for _, _, _, before, drawn in blind)
    assert 0 < start < half < whole
    assert overview == 0


def test_runs_are_in_step_and_one_that_ended_stays(run, blind, tmp_path, monkeypatch):
    from surgsim.export.subjects import RunSubject
    from surgsim.recording.read import Recorded
    from surgsim.trace.trace import Ending, Trace, TraceMeta

    half = len(run.trace) // 2
    meta = run.trace.meta
    ending = Ending(outcome=Outcome.RCM_LIMIT, t_s=float(run.trace["t_s"][half - 1]))
    cut = TraceMeta(
        scenario=meta.scenario, control_period_s=meta.control_period_s, limits=meta.limits, ending=ending
    )
    short = RunSubject(path=run.path.with_name("short"), summary={})
    shorter = Trace(run.trace.data[:half], run.trace.blocks, cut)
    short.__dict__["recorded"] = Recorded(trace=shorter, metrics={})
    settings = VideoSettings(fps=20.0, size=(128, 48))
    told = []
    monkeypatch.setattr(
        "surgsim.export.video.written",
        lambda picture, head, text, note: told.append((head, text.split()[0])) or picture,
    )
    counts = []
    file = tmp_path / "two.gif"
    write_video(file, [run, short], settings, lambda *count: counts.append(count))
    times = picture_times(float(run.trace["t_s"][-1]), 0.05)
    assert counts == [(k + 1, len(times)) for k in range(len(times))]
    for (_, q, _, _, _), (_, q_short, _, _, _), time_s in zip(blind[::2], blind[1::2], times, strict=True):
        row = int(np.argmin(np.abs(run.trace["t_s"] - time_s)))
        assert np.array_equal(q[:7], run.trace.block("q")[row])
        assert np.array_equal(q_short[:7], run.trace.block("q")[min(row, half - 1)])
    assert told[0][0] == "pinv (run)"
    assert told[-2][0] == "pinv (run)"
    assert told[-1][0] == "pinv (short): rcm limit"
    with Image.open(file) as image:
        shown_ms = [frame.info["duration"] for frame in ImageSequence.Iterator(image)]
        assert image.size == (128, 48)
    assert sum(shown_ms) == 50 * len(times)  # equal pictures after each other are one


@pytest.mark.parametrize(
    ("end_s", "step_s", "times"),
    [
        (0.2, 0.1, [0.0, 0.1, 0.2]),
        (0.25, 0.1, [0.0, 0.1, 0.2, 0.25]),
        (0.3, 0.1, [0.0, 0.1, 0.2, 0.3]),
        (0.05, 0.1, [0.0, 0.05]),
    ],
)
def test_the_last_picture_is_the_end(end_s, step_s, times):
    assert picture_times(end_s, step_s).tolist() == pytest.approx(times)


def test_the_row_of_a_time():
    t_s = np.array([0.0, 0.001, 0.002])
    assert [row_at(t_s, time) for time in (0.0, 0.0009, 0.001 - 1e-12, 0.0015, 5.0)] == [0, 0, 1, 1, 2]


def test_places_of_the_panels():
    wide = (1280, 720)
    assert [grid_of(runs, 1, wide) for runs in (1, 2, 3, 4, 6)] == [(1, 1), (2, 1), (2, 2), (2, 2), (3, 2)]
    assert grid_of(1, 3, wide) == (2, 2)
    assert grid_of(3, 2, wide) == (3, 2)
    panels = [np.full((2, 4, 3), k, dtype=np.uint8) for k in (1, 2, 3)]
    assert side_by_side(panels, 2)[::2, ::4, 0].tolist() == [[1, 2], [3, 0]]


def test_a_narrow_picture_shows_from_side_to_side_what_a_wide_one_does():
    wide, narrow = 1.5, 0.6
    (fovy,) = widened(np.array([36.0]), narrow)
    assert narrow * np.tan(np.deg2rad(fovy) / 2) == pytest.approx(wide * np.tan(np.deg2rad(18.0)))
    assert widened(np.array([36.0]), 2.0) == pytest.approx([36.0])


def test_figures_are_as_long_at_every_time_and_are_written_into_the_band_below(run):
    rows = range(0, len(run.trace), 37)
    assert len({len(figures(run.trace, row)) for row in rows}) == 1
    last = len(run.trace) - 1
    assert f"{1e3 * run.trace['rcm_error_m'][last]:.3f} mm" in figures(run.trace, last)
    dark = np.zeros((120, 320, 3), dtype=np.uint8)
    shown = written(dark, "name", figures(run.trace, last))
    assert shown.max() > 200
    assert shown[:80].max() == 0
    assert written(dark, "name", "text", "inside")[:20].max() > 100
    assert written(dark, "name", "text", lines=6)[:80].max() > 200  # larger letters, a higher band


def test_a_gif_has_hundredths_of_a_second(tmp_path):
    assert period_of(tmp_path / "a.gif", 30.0) == pytest.approx(0.03)
    assert period_of(tmp_path / "a.gif", 1000.0) == pytest.approx(0.01)
    assert period_of(tmp_path / "a.mp4", 30.0) == pytest.approx(1.0 / 30.0)


@pytest.mark.parametrize("text", ["64", "64x", "64x49", "axb", "0x0", "99999x64", "-64x64"])
def test_sizes_that_no_video_has(text):
    with pytest.raises(SurgsimError, match="is not WIDTHxHEIGHT in even numbers of pixels from 32 to 4096"):
        parse_size(text)
    assert parse_size("64x48") == (64, 48)


def test_an_interruption_leaves_no_file(run, blind, tmp_path):
    def stop(done, total):
        raise Stopped(2)

    with pytest.raises(Stopped):
        write_video(tmp_path / "run.gif", [run], VideoSettings(size=(64, 48)), stop)
    assert list(tmp_path.iterdir()) == []


def test_what_makes_no_video(run_folder, unrecorded, made_results, told, tmp_path, monkeypatch):
    gif = ("--video", tmp_path / "x.gif")
    assert told(made_results(), *gif) == (
        2,
        "surgsim: --video is of runs; --run RUN_ID takes some out of a batch\n",
    )
    assert "a run without recording" in told(unrecorded, *gif)[1]
    assert told(run_folder, *gif, "--camera", "inseid")[1].endswith("Did you mean 'inside'?\n")
    assert (
        told(run_folder, *gif, "--speed", "0")[1] == "surgsim: --speed: 0 is not allowed: from 0.01 to 1000\n"
    )
    assert "7 runs are more than the 6" in told(*[run_folder] * 7, *gif)[1]
    monkeypatch.setitem(sys.modules, "av", None)
    assert told(run_folder, "--video", tmp_path / "x.mp4") == (
        2,
        "surgsim: --video FILE.mp4 needs PyAV: pip install 'surgsim[video]'\n",
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.needs("opengl", "video")
def test_the_real_thing(run_folder, tmp_path):
    """In a process of its own, which finds out by itself how to draw without a display."""
    import av

    words = ["--camera", "overview,inside", "--fps", "10", "--size", "96x48", "--speed", "6"]
    files = [tmp_path / "run.mp4", tmp_path / "run.gif"]
    command = [sys.executable, "-m", "surgsim", "export", run_folder, *words]
    for file in files:
        command += ["--video", file]
    hidden = ("MUJOCO_GL", "DISPLAY")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    with av.open(str(files[0])) as container:
        stream = container.streams.video[0]
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        assert (stream.codec_context.name, stream.average_rate) == ("h264", 10)
    with Image.open(files[1]) as image:
        assert image.n_frames == len(pictures) == 2
        assert image.size == (96, 48)
    for picture in pictures:
        assert picture.shape == (48, 96, 3)
        left, right = picture[:30, :48].astype(int), picture[:30, 48:].astype(int)
        assert left.std() > 20.0
        assert left[..., 0].mean() < left[..., 2].mean()  # the theatre is blue and green
        assert right[..., 0].mean() > right[..., 2].mean() + 10.0  # the patient is red inside
