"""A run that is watched: what the viewer is sent is what is recorded, and the run is the same."""

import socket
from contextlib import contextmanager

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

import surgsim
from surgsim.cli.main import main
from surgsim.live import showing
from surgsim.recording.layout import HEADER, TIMELINE
from surgsim.scenario.load import load_experiment
from surgsim.simulate.loop import simulate

SHORT = {"task.duration_s": 0.6, "task.ramp_s": 0.2, "task.hold_end_s": 0.1}


@pytest.fixture
def sent(monkeypatch, tmp_path):
    """The file that holds what a viewer would be sent."""
    path = tmp_path / "sent.rrd"

    @contextmanager
    def to_file(address):
        stream = rr.RecordingStream("surgsim", send_properties=False)
        stream.save(path)
        yield stream
        stream.disconnect()

    monkeypatch.setattr(showing, "viewer", to_file)
    return path


def _entities(path):
    """For every entity its components, and the times at which something was said of it."""
    found = {}
    for chunk in RrdReader(path).stream():
        if str(chunk.entity_path).startswith("/__"):
            continue
        batch = chunk.to_record_batch()
        names, times = found.setdefault(str(chunk.entity_path), (set(), set()))
        for field in batch.schema:
            kind = (field.metadata or {}).get(b"rerun:kind", b"").decode()
            if kind == "index" and field.name == TIMELINE:
                times.update(batch.column(field.name).cast("int64").to_pylist())
            elif kind == "data":
                names.add(field.name)
    return found


def test_the_viewer_is_sent_what_is_recorded(sent, tmp_path):
    scenario = surgsim.load("breathing_hidden_lwr4plus", settings=SHORT)
    folder = tmp_path / "run"
    result = showing.run_shown(scenario, folder, None, realtime=False)
    live, recorded = _entities(sent), _entities(folder / "recording.rrd")
    assert set(live) == {name for name in recorded if name.strip("/") != HEADER}
    for name, (components, _) in live.items():
        assert components == recorded[name][0], name
    moving = [name for name in recorded if "/link" in name and name.count("/") == 2]
    assert len(moving) > 5
    for name in moving:
        if recorded[name][1]:  # one that stands all the time is recorded once
            assert recorded[name][1] <= live[name][1]
    plain = surgsim.run(scenario)
    for block in ("q", "tau", "tip"):
        assert np.array_equal(result.trace.block(block), plain.trace.block(block), equal_nan=True)


def test_the_viewer_is_sent_what_is_recorded_of_two_arms(sent, tmp_path):
    settings = {f"arms.{k}.{key}": value for k in (0, 1) for key, value in SHORT.items()}
    scenario = load_experiment("two_ports_panda", assignments=[f"{k}={v}" for k, v in settings.items()])
    folder = tmp_path / "run"
    result = showing.run_shown(scenario, folder, None, realtime=False)
    live, recorded = _entities(sent), _entities(folder / "recording.rrd")
    assert set(live) == {name for name in recorded if name.strip("/") != HEADER}
    for name, (components, _) in live.items():
        assert components == recorded[name][0], name
    for arm in ("left", "right"):
        for name in (f"/scene/{arm}/link7", f"/scene/{arm}/tip", f"/{arm}/signals/q"):
            assert max(live[name][1]) == max(recorded[name][1]) > 1e9, name
    assert result.trace.equals(simulate(scenario))


def test_a_run_that_fails_is_shown_to_its_end(sent, tmp_path):
    """The stop after the outcome is part of it."""
    scenario = surgsim.load("safety/velocity_limit")
    result = showing.run_shown(scenario, tmp_path / "run", None, realtime=False, record=False)
    last = round(1e9 * float(result.trace["t_s"][-1]))
    assert max(max(times) for _, times in _entities(sent).values() if times) == last
    assert not (tmp_path / "run" / "recording.rrd").exists()


def test_it_keeps_time_with_the_clock(sent, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(showing.Pace, "wait", lambda self, t_s: asked.append(t_s))
    scenario = surgsim.load("circle_panda", settings={"task.duration_s": 0.5, "task.ramp_s": 0.1})
    showing.run_shown(scenario, tmp_path / "run", None, record=False)
    assert np.all(np.diff(asked) >= 0.0)
    assert asked[-1] > 1.0
    assert asked[0] == pytest.approx(showing.PIECE_S)


def test_a_viewer_at_an_address_is_sent_it(tmp_path, capsys):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = rr.RecordingStream("surgsim_test_server")
    server.serve_grpc(grpc_port=port)
    words = [word for key, value in SHORT.items() for word in ("--set", f"{key}={value}")]
    where = f"127.0.0.1:{port}"
    out = str(tmp_path / "run")
    assert main(["run", "circle_panda", *words, "--live", where, "--pace", "free", "--out", out]) == 0
    server.disconnect()
    assert "wrote" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--live"], "this session has no display"),
        (["--live", "nowhere"], "'nowhere' is no address; give HOST:PORT"),
        (["--live", "localhost:1"], "no viewer answers at localhost:1"),
        (["--live", "localhost:99999999"], "no viewer answers at localhost:99999999"),
        (["--live", "--operator", "keyboard"], "--live and --operator do not go together"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(words, told, tmp_path, capsys, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert main(["run", "circle_panda", *words, "--out", str(tmp_path / "run")]) == 2
    text = capsys.readouterr().err
    assert told in text
    assert len(text.strip().splitlines()) == 1
    assert not (tmp_path / "run").exists()
