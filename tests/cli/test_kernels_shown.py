"""What a person sees of kernels that are compiled: nothing when they are there."""

import itertools
import os
import re
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from surgsim.cli import kernels
from surgsim.cli.kernels import compiled_by_two, compiling_shown, on_screen
from surgsim.compiled import cache, places, watch
from surgsim.compiling import Compiling, tell
from surgsim.scenario.load import load_experiment, load_scenario
from surgsim.simulate import ahead


def compile_two():
    for name in ("a", "b"):
        for ended in (False, True):
            tell(Compiling(kernel=name, most=7, ended=ended))


@pytest.fixture
def place(monkeypatch, tmp_path):
    """The only folder for kernels: no temporary one, with one that was just compiled."""
    place = tmp_path / "kernels"
    place.mkdir(mode=0o700)
    (place / "a.nbi").touch()
    os.utime(place / "a.nbi", (time.time() + 60.0,) * 2)
    monkeypatch.setattr(places, "places", lambda: (place,))
    monkeypatch.setattr(kernels.tempfile, "gettempdir", lambda: "/nowhere")
    return place


@pytest.fixture
def clock(monkeypatch):
    """Sets the seconds that pass from one look at the clock to the next."""

    def every(step_s):
        now = itertools.count(0.0, step_s)
        monkeypatch.setattr(kernels.time, "perf_counter", lambda: next(now))

    return every


def test_a_warm_start_shows_nothing(capsys):
    with compiling_shown():
        pass
    assert capsys.readouterr() == ("", "")


def test_short_waits_are_not_worth_a_line_in_a_log(capsys, place):
    with compiling_shown():
        compile_two()
    assert capsys.readouterr() == ("", "")


def test_one_line_in_a_log(capsys, place, clock):
    clock(1.0)
    with compiling_shown():
        for _ in range(40):
            compile_two()
    assert capsys.readouterr() == ("", "compiling kernels (once): at most 7, less than a minute\n")


@pytest.fixture
def second(monkeypatch):
    """What a second process is asked for."""
    asked = []

    @contextmanager
    def ahead_of():
        asked.append("started")
        yield asked.append
        asked.append("ended")

    monkeypatch.setattr(ahead, "compiling_ahead", ahead_of)
    return asked


def test_a_second_process_starts_at_once_where_no_kernel_is_kept(place, second):
    (place / "a.nbi").unlink()
    with compiling_shown(), compiled_by_two() as runs:
        assert second == ["started"]
        runs(load_scenario("circle_lwr4plus"))
        assert second == ["started", 7]
        compile_two()
    assert second == ["started", 7, "ended"]


def test_else_it_starts_once_and_only_if_something_is_compiled(place, clock, second):
    clock(1.0)
    with compiling_shown(), compiled_by_two() as runs:
        runs(load_scenario("circle_lwr4plus"))
        assert second == []
        compile_two()
        compile_two()
        assert second == ["started", 7]
    assert second == ["started", 7, "ended"]


def test_it_ends_where_several_arms_run(place, clock, second):
    (place / "a.nbi").unlink()
    clock(1.0)
    with compiling_shown(), compiled_by_two() as runs:
        runs(load_experiment("two_ports_lwr4plus"))
        assert second == ["started", "ended"]
        compile_two()
    assert second == ["started", "ended"]


@pytest.mark.parametrize("refusal", ["nothing can be kept", "nothing can be looked at"])
def test_none_starts_for_nothing_and_a_folder_that_refuses_is_no_error(monkeypatch, place, second, refusal):
    (place / "a.nbi").unlink()
    if refusal == "nothing can be kept":
        monkeypatch.setattr(cache, "prepared", lambda place: False)
    else:

        def refused(self, pattern):
            raise PermissionError

        monkeypatch.setattr(Path, "glob", refused)
    with compiling_shown(), compiled_by_two():
        assert second == ([] if refusal == "nothing can be kept" else ["started"])


def test_how_long_many_take(capsys, place, clock):
    clock(4.0)
    with compiling_shown():
        for ended in (False, True):
            tell(Compiling(kernel="a", most=185, ended=ended))
    assert capsys.readouterr().err == "compiling kernels (once): at most 185, a minute or two\n"


def test_what_takes_longer_than_the_line_said_gets_another_one(capsys, place, clock):
    clock(100.0)
    with compiling_shown():
        compile_two()
        compile_two()
    assert capsys.readouterr().err == (
        "compiling kernels (once): at most 7, less than a minute\n"
        "compiling kernels (once): 2 of at most 7\n"
        "compiling kernels (once): 3 of at most 7\n"
        "compiling kernels (once): 4 of at most 7\n"
    )


def test_one_line_on_a_terminal(capsys, monkeypatch, place):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with compiling_shown():
        compile_two()
        with on_screen(lambda text: print(f"<{text}>", file=sys.stderr)):
            compile_two()
    clear = "\r\x1b[K"
    head = "compiling kernels (once): "
    assert capsys.readouterr().err == (
        f"{clear}{head}0 of at most 7{clear}{clear}{head}1 of at most 7{clear}"
        f"<{head}2 of at most 7>\n<{head}3 of at most 7>\n<{head}3 of at most 7>\n<{head}4 of at most 7>\n"
        f"{clear}compiled 4 kernels in 0 s; kept for the next start\n"
    )


def test_what_is_kept_among_temporary_files_is_not_promised(capsys, monkeypatch, place, tmp_path):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(kernels.tempfile, "gettempdir", lambda: str(tmp_path))
    with compiling_shown():
        compile_two()
    assert capsys.readouterr().err.endswith("compiled 2 kernels in 0 s; kept among the temporary files\n")


def test_kernels_that_a_full_disk_did_not_take_are_not_promised(capsys, monkeypatch, place):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    (place / "a.nbi").unlink()
    with compiling_shown():
        compile_two()
    assert capsys.readouterr().err.endswith("compiled 2 kernels in 0 s\n")


NOWHERE = """
import sys
from pathlib import Path
from surgsim.cli import kernels
from surgsim.compiled import cache, places

cache.places = places.places = lambda: (Path({place!r}),)
kernels._PATIENCE_S = 0.0
sys.path.insert(0, {folder!r})
with kernels.compiling_shown():
    import doubled
    print(doubled.twice(1.0), doubled.thrice(1.0))
"""
DOUBLED = """from surgsim.compiled import compiled

@compiled
def twice(x):
    return 2.0 * x

@compiled
def thrice(x):
    return 3.0 * x
"""


@pytest.fixture
def nowhere(tmp_path):
    """A program that compiles two kernels where no folder can be written, and what it says of that."""
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "doubled.py").write_text(DOUBLED, encoding="utf-8")
    place = tmp_path / "file" / "kernels"
    why = f"surgsim: kernels are compiled at every start: none of these folders can be written: {place}"
    return NOWHERE.format(place=str(place), folder=str(tmp_path)), why


def test_where_nothing_can_be_kept_a_log_has_one_line(nowhere):
    program, why = nowhere
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=100)
    assert (done.stdout, done.stderr) == ("2.0 3.0\n", f"{why}\n")


def test_where_nothing_can_be_kept_a_terminal_promises_nothing(nowhere, terminal):
    program, why = nowhere
    done = terminal(sys.executable, "-c", program, columns=400).wait()
    assert done.lines[0] == why
    assert "compiling kernels: 1 of at most 2" in done.lines
    assert "once" not in done.text
    assert any(re.fullmatch(r"compiled 2 kernels in \d+ s", line) for line in done.lines), done.text


def test_waiting_for_another_process_is_said_unless_workers_wait_for_each_other(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with compiling_shown():
        tell(Compiling(kernel="a", most=7, ended=False, awaited=True))
    waiting = "waiting for kernels that another process compiles"
    assert capsys.readouterr().err == f"\r\x1b[K{waiting}\r\x1b[K"
    with compiling_shown():
        tell(Compiling(kernel="a", most=7, ended=False))
        tell(Compiling(kernel="a", most=7, ended=False, awaited=True))
        tell(Compiling(kernel="a", most=7, ended=True))
    said = capsys.readouterr().err
    assert waiting not in said
    assert "compiled 1 kernel in 0 s" in said


IN_A_BAR = """
import time
from surgsim.cli.kernels import compiling_shown
from surgsim.cli.output import show_batch_progress, show_progress
from surgsim.compiling import Compiling, tell

def compile_one():
    for ended in (False, True):
        tell(Compiling(kernel="a", most=185, ended=ended))
        time.sleep(0.3)  # the bar is drawn ten times a second

with compiling_shown(), {bar}("a scenario and a controller") as update:
    compile_one()
    update(*{reached})
    time.sleep(0.3)
    compile_one()
"""


@pytest.mark.parametrize(
    ("bar", "reached"), [("show_progress", (7.0, 7.0)), ("show_batch_progress", (5, 1000, "completed"))]
)
@pytest.mark.parametrize("columns", [80, 120])
def test_a_bar_says_how_many_kernels_there_are_and_are_done(terminal, bar, reached, columns):
    done = terminal(sys.executable, "-c", IN_A_BAR.format(bar=bar, reached=reached), columns=columns).wait()
    assert done.status == 0, done.text
    for count in (0, 1, 2):
        shown = f"compiling kernels (once): {count} of at most 185 "
        assert any(line.startswith(shown) for line in done.lines), done.text
    assert all(len(line) <= columns for line in done.lines)


def test_a_bar_that_is_full_says_what_goes_on(terminal):
    done = terminal(sys.executable, "-c", IN_A_BAR.format(bar="show_progress", reached=(7.0, 7.0))).wait()
    assert any("7.0/7.0 s  metrics, files" in line for line in done.lines), done.text


def test_clocks_stand_still_while_a_kernel_compiles():
    wall, thread = watch.working_time(), watch.thread_time_ns()
    began = time.perf_counter()
    timer = watch._Timer()
    timer.on_start(None)
    while time.perf_counter() - began < 0.2:
        pass
    timer.on_start(None)  # the kernel calls another one
    timer.on_end(None)
    timer.on_end(None)
    assert watch.working_time() - wall < 0.1
    assert 1e-9 * (watch.thread_time_ns() - thread) < 0.1
