"""What a person sees of kernels that are compiled: nothing when they are there."""

import sys
import time

import pytest

from surgsim.cli import kernels
from surgsim.cli.kernels import compiling_shown, on_screen
from surgsim.compiled import watch
from surgsim.compiling import Compiling, tell


def compile_two():
    for name in ("a", "b"):
        for ended in (False, True):
            tell(Compiling(kernel=name, most=7, ended=ended))


def test_a_warm_start_shows_nothing(capsys):
    with compiling_shown():
        pass
    assert capsys.readouterr() == ("", "")


def test_short_waits_are_not_worth_a_line_in_a_log(capsys):
    with compiling_shown():
        compile_two()
    assert capsys.readouterr() == ("", "")


def test_lines_in_a_log(capsys, monkeypatch):
    now = iter(range(0, 400, 4))
    monkeypatch.setattr(kernels.time, "perf_counter", lambda: float(next(now)))
    with compiling_shown():
        compile_two()
    assert capsys.readouterr() == (
        "",
        "compiling kernels (once): 1 of at most 7\n"
        "compiling kernels (once): 2 of at most 7\n"
        "compiled 2 kernels in 8 s; the next start finds them\n",
    )


def test_one_line_on_a_terminal(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with compiling_shown():
        compile_two()
        with on_screen(lambda text: print(f"<{text}>", file=sys.stderr)):
            compile_two()
    clear = "\r\x1b[K"
    head = "compiling kernels (once): "
    assert capsys.readouterr().err == (
        f"{clear}{head}0 of at most 7{clear}{head}1 of at most 7"
        f"{clear}{head}1 of at most 7{clear}{head}2 of at most 7"
        f"<{head}2 of at most 7>\n<{head}3 of at most 7>\n<{head}3 of at most 7>\n<{head}4 of at most 7>\n"
        f"{clear}compiled 4 kernels in 0 s; the next start finds them\n"
    )


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
