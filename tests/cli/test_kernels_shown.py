"""What a person sees of kernels that are compiled: nothing when they are there."""

import sys
import time

import pytest

from surgsim.cli import kernels
from surgsim.cli.kernels import compiling_shown, on_screen
from surgsim.cli.output import show_batch_progress, show_progress
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


@pytest.mark.parametrize("bar", [show_progress, show_batch_progress])
def test_a_bar_shows_it_in_the_place_of_its_label(bar, capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "80")
    with compiling_shown(), bar("my label"):
        compile_two()
        time.sleep(0.3)  # the bar is drawn ten times a second
    assert "compiling kernels (once): 2 of at most 7" in capsys.readouterr().err


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
