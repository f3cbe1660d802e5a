"""A person at the console, without a display: the window is a script."""

import json
import os
import signal
import time

import numpy as np
import pytest
from numba.core import event

from surgsim.cli.main import main
from surgsim.live import operate
from surgsim.live.pace import Pace
from surgsim.live.picture import Picture, screen_axes
from surgsim.live.window import check_display
from surgsim.recording.read import read_recording
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

SHORT = ("--set", "theatre=false", "--set", "task.hold_end_s=0.1", "--set", "task.channel.delay_s=0.05")
RIGHT, UP, SPACE, ESCAPE, ROLL_RIGHT, CTRL = 262, 265, 32, 256, 269, 341


class Clock:
    """Wall time that passes only while somebody sleeps, or by `work_s` at every look."""

    def __init__(self, work_s=0.0):
        self.now_s, self.work_s, self.slept_s = 5.0, work_s, 0.0

    def __call__(self):
        self.now_s += self.work_s
        return self.now_s

    def sleep(self, time_s):
        self.now_s += time_s
        self.slept_s += time_s


class Scripted:
    """A window whose user does something at every picture."""

    script = ()
    closes_at = None
    shown = ()

    def __init__(self, setup, keyboard):
        self._keyboard = keyboard
        Scripted.shown = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    @property
    def is_open(self):
        return self.closes_at is None or len(self.shown) < self.closes_at

    def axes(self):
        return np.eye(3)

    def show(self, truth, status):
        self.shown.append(status)
        for picture, act in self.script:
            if picture == len(self.shown):
                act(self._keyboard)


def press(key):
    return lambda keyboard: keyboard.changed(key, True)


def let_go(key):
    return lambda keyboard: keyboard.changed(key, False)


@pytest.fixture
def person(tmp_path, monkeypatch):
    """Runs a scenario with a person who does `script`, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(operate, "check_display", lambda: None)
    monkeypatch.setattr(operate, "Window", Scripted)
    clock = Clock()
    monkeypatch.setattr(operate, "Pace", lambda: Pace(clock, clock.sleep))

    def run(*words, script=(), closes_at=None, scenario="teleop_free_motion_panda"):
        monkeypatch.setattr(Scripted, "script", script)
        monkeypatch.setattr(Scripted, "closes_at", closes_at)
        return main(["run", scenario, "--operator", "keyboard", *SHORT, *words])

    return run


def same(a, b):
    """Names of the blocks in which two traces differ, but for wall time."""
    assert len(a) == len(b)
    pairs = ((block.name, a.block(block.name), b.block(block.name)) for block in a.blocks)
    return {name for name, x, y in pairs if not np.array_equal(x, y, equal_nan=True)} - {"control_time"}


def test_what_a_person_did_is_recorded_and_plays_back_bit_for_bit(person, tmp_path):
    script = (
        (2, press(RIGHT)),
        (10, let_go(RIGHT)),
        (12, press(UP)),
        (14, press(SPACE)),
        (20, let_go(UP)),
        (22, press(ESCAPE)),
    )
    assert person("--out", "live", script=script) == 0
    live = read_recording(tmp_path / "live").trace
    assert live["handle_x_m"][-1] > live["handle_x_m"][0] + 1e-3
    assert live["tip_x_m"][-1] > live["tip_x_m"][0] + 5e-4
    assert live["hand_intended_y_m"][-1] > live["hand_intended_y_m"][0] + 1e-3
    assert live["jaw"][-1] > 0.5
    assert live["operator_done"][-1] == 1.0
    assert live["t_s"][-1] == pytest.approx(live["t_s"][np.argmax(live["operator_done"])] + 0.1)

    tape = tmp_path / "live" / "operator_input.csv"
    again = ["run", "live/scenario.yaml", "--operator", str(tape), "--out", "again"]
    assert main(again) == 0
    replay = read_recording(tmp_path / "again").trace
    assert same(live, replay) == set()
    assert (tmp_path / "again" / "operator_input.csv").read_bytes() == tape.read_bytes()
    sums = [json.loads((tmp_path / d / "metrics.json").read_text()) for d in ("live", "again")]
    assert len({one["provenance"]["operator_input_sha256"] for one in sums}) == 1

    lines = tape.read_text().splitlines()
    tape.write_text("\n".join([*lines[:2], lines[2].replace("0.02", "0.021"), *lines[3:]]) + "\n")
    assert main([*again[:-1], "other"]) == 0
    assert "tip" in same(replay, read_recording(tmp_path / "other").trace)


def test_a_person_rolls_the_instrument_and_re_indexes_the_handle(person, tmp_path):
    script = (
        (2, press(ROLL_RIGHT)),
        (14, let_go(ROLL_RIGHT)),
        (20, press(CTRL)),
        (28, press(RIGHT)),
        (40, let_go(RIGHT)),
        (72, let_go(CTRL)),
        (84, press(ESCAPE)),
    )
    assert person("--out", "live", "--set", "task.roll.use=true", script=script) == 0
    assert dict(Scripted.shown[50].lines)["clutch"] == "open"
    assert dict(Scripted.shown[-1].lines)["clutch"] == "closed"
    live = read_recording(tmp_path / "live").trace
    assert 0.1 < live["roll_command_rad"][-1] < 0.25
    assert live["roll_rad"][-1] == pytest.approx(live["roll_command_rad"][-1], abs=5e-3)
    opened = live["clutch_engaged"] == 0.0
    assert np.ptp(live["handle_x_m"][opened]) > 1e-3
    assert live["tip_x_m"][-1] == pytest.approx(live["tip_x_m"][0], abs=2e-4)
    again = ["run", "live/scenario.yaml", "--operator", "live/operator_input.csv", "--out", "again"]
    assert main(again) == 0
    assert same(live, read_recording(tmp_path / "again").trace) == set()


@pytest.mark.parametrize(
    ("script", "closes_at"),
    [
        ([], 6),
        ([(6, lambda _: os.kill(os.getpid(), signal.SIGINT))], None),
        ([(6, lambda _: os.kill(os.getpid(), signal.SIGTERM))], None),
    ],
    ids=["window closed", "ctrl-c", "terminated"],
)
def test_however_it_is_left_nothing_is_lost(person, tmp_path, script, closes_at):
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    assert person("--no-record", "--out", "live", script=script, closes_at=closes_at) == 0
    summary = json.loads((tmp_path / "live" / "metrics.json").read_text())
    assert 0.1 < summary["outcome"]["t_s"] < 0.4
    assert (tmp_path / "live" / "operator_input.csv").read_text().endswith(",1\n")
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_it_ends_with_the_scenario_s_time_and_says_what_is_worth_knowing(person, tmp_path):
    assert person("--no-record", "--set", "task.duration_s=0.3") == 0
    assert person("--no-record", "--set", "task.duration_s=0.3") == 0
    folder = tmp_path / "runs" / "teleop_free_motion_panda"
    assert sorted(path.name for path in folder.iterdir()) == [
        "passive_kinetic-seed0-keyboard1",
        "passive_kinetic-seed0-keyboard2",
    ]
    lines = dict(Scripted.shown[-1].lines)
    assert lines["time"] == "0.3 of 0.3 s"
    assert lines["speed"] == "20 mm/s"
    assert lines["real time"] == "1.00x"


def test_a_person_s_input_is_never_overwritten(person, capsys):
    assert person("--no-record", "--out", "live", closes_at=1) == 0
    capsys.readouterr()
    assert person("--no-record", "--out", "live", closes_at=1) == 2
    assert main(["run", "teleop_free_motion_panda", "--out", "live"]) == 2
    said = "surgsim: live holds 'operator_input.csv', which is not a run's; choose another --out\n"
    assert capsys.readouterr().err == 2 * said


def test_compiling_is_not_counted_as_simulating(person, tmp_path, monkeypatch):
    """Half a second in which numba compiles, told by its own events, while the tape is played."""
    assert person("--no-record", "--out", "live", closes_at=1) == 0
    real = Simulation.run

    def run(simulation, progress=None):
        with event.trigger_event("numba:compiler_lock"):
            time.sleep(0.5)
        return real(simulation, progress)

    monkeypatch.setattr(Simulation, "run", run)
    scenario = load_scenario("live/scenario.yaml")
    began = time.perf_counter()
    result = operate.operate(scenario, "live/operator_input.csv", tmp_path / "again", record=False)
    assert result.wall_time_s < time.perf_counter() - began - 0.5


def test_errors_are_one_line(person, monkeypatch, capsys):
    assert main(["run", "circle_lwr4plus", "--operator", "keyboard"]) == 2
    assert main(["run", "teleop_free_motion_panda", "--operator", "nowhere.csv"]) == 2
    monkeypatch.setattr(operate, "check_display", check_display)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    assert person() == 2
    assert capsys.readouterr().err.splitlines() == [
        "surgsim: circle_lwr4plus: --operator needs task 'teleoperation', not 'circle'",
        "surgsim: nowhere.csv: cannot be read: No such file or directory",
        "surgsim: operating needs a display, and this session has none",
    ]


def test_a_fast_simulation_waits_for_the_clock_and_a_slow_one_says_so():
    clock = Clock()
    pace = Pace(clock, clock.sleep)
    for k in range(1, 200):
        pace.wait(0.016 * k)
    assert clock.slept_s == pytest.approx(0.016 * 199)
    assert pace.factor == pytest.approx(1.0)
    clock = Clock(work_s=0.02)  # two looks a picture: 40 ms for 16 ms
    pace = Pace(clock, clock.sleep)
    for k in range(1, 200):
        pace.wait(0.016 * k)
    assert clock.slept_s == 0.0
    assert pace.factor == pytest.approx(0.4, rel=0.03)


def test_lost_time_is_given_up():
    clock = Clock()
    pace = Pace(clock, clock.sleep)
    clock.now_s += 10.0
    pace.wait(0.016)
    pace.wait(0.032)
    assert clock.slept_s == pytest.approx(0.016)


def test_the_picture_has_everything_where_the_plant_has_it():
    scenario = load_scenario("peg_and_ring_panda", assignments=("theatre=false",))
    setup = prepare(scenario)
    setup.plant.reset(setup.q_start)
    for _ in range(50):
        setup.plant.step(np.full(7, 3.0), np.zeros(7))
    truth = setup.plant.truth()
    picture = Picture(setup)
    picture.place(truth)
    import mujoco

    mujoco.mj_kinematics(picture.model, picture.data)
    tip = picture.data.site_xpos[setup.scene.tip_site]
    np.testing.assert_allclose(tip, truth.p_WT, atol=1e-12)
    names = [name for block in setup.plant.columns for name in block.columns]
    rings = [block.name for block in setup.plant.columns if f"{block.name}_quat_w" in names]
    assert len(rings) == 3
    for ring in rings:
        place = [truth.values[names.index(f"{ring}_{axis}_m")] for axis in "xyz"]
        body = picture.model.jnt_bodyid[picture.model.joint(ring).id]
        np.testing.assert_allclose(picture.data.xpos[body], place, atol=1e-12)


@pytest.mark.parametrize("azimuth", [0.0, 90.0, 200.0])
def test_screen_axes_are_those_of_the_drawn_camera(azimuth):
    import mujoco

    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera, scene = mujoco.MjvCamera(), mujoco.MjvScene(model, 10)
    camera.azimuth, camera.elevation, camera.distance = azimuth, -35.0, 2.0
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, mujoco.mjtCatBit.mjCAT_ALL, scene)
    forward, up = np.array(scene.camera[0].forward), np.array(scene.camera[0].up)
    right, away, upward = screen_axes(camera).T
    np.testing.assert_allclose(right, np.cross(forward, up), atol=1e-6)
    assert away @ forward > 0.8
    assert upward @ up > 0.8
    np.testing.assert_allclose(np.linalg.det(screen_axes(camera)), 1.0)
