"""A second process compiles the kernels that every run needs: the right ones, while it is wanted."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from surgsim.compiled.dispatcher import Kernel
from surgsim.control.decision import decide
from surgsim.control.manifold import climb, climb_from, is_inside, project
from surgsim.control.manipulability import manipulability
from surgsim.metrics.catalog import compute_metrics
from surgsim.scenario.load import load_scenario
from surgsim.simulate import ahead, kernels_of_every_run
from surgsim.simulate.derived import derive
from surgsim.simulate.loop import simulate
from surgsim.simulate.ticks import ask_task, hold_ticks, run_ticks

KERNELS: tuple[Kernel, ...] = (
    run_ticks,
    hold_ticks,
    ask_task,
    decide,
    derive,
    project,
    manipulability,
    climb,
    is_inside,
    climb_from,
)


def forms():
    return {kernel.py_func.__name__: (set(kernel.overloads), set(kernel._of_signature)) for kernel in KERNELS}


def test_what_is_compiled_ahead_is_what_a_run_asks_for():
    compute_metrics(simulate(load_scenario("circle_lwr4plus", assignments=["task.duration_s=3"])))
    asked = forms()
    assert all(overloads or signatures for overloads, signatures in asked.values())
    kernels_of_every_run.compile_kernels(7)
    assert forms() == asked


def words_of(pid, name):
    """What the kernel tells of a process."""
    return Path(f"/proc/{pid}/{name}").read_text(encoding="utf-8").split()


def children(pid):
    return [int(word) for word in words_of(pid, f"task/{pid}/children")]


def test_the_process_ends_with_the_block():
    before = set(children(os.getpid()))
    with ahead.compiling_ahead():
        (helper,) = set(children(os.getpid())) - before
    assert helper not in children(os.getpid())


STAND_IN = """
from surgsim.simulate import kernels_of_every_run as program
program.compile_kernels = lambda joints: print(joints, flush=True)
program.main()
"""


def test_the_process_compiles_for_the_joints_that_it_is_told():
    with subprocess.Popen(
        [sys.executable, "-c", STAND_IN],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        process.stdin.write(b"7\n")
        process.stdin.flush()
        assert process.wait(60) == 0  # with its input still open
        assert (process.stdout.read(), process.stderr.read()) == (b"7\n", b"")


def test_the_process_ends_where_nobody_tells_it_anything():
    done = subprocess.run([sys.executable, "-c", STAND_IN], input=b"", capture_output=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")


def test_on_one_processor_there_is_none(monkeypatch):
    monkeypatch.setattr(ahead, "cores", lambda: 1)
    before = children(os.getpid())
    with ahead.compiling_ahead() as compile_for_joints:
        assert children(os.getpid()) == before
        compile_for_joints(7)


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks into /proc")
def test_the_process_ends_when_the_first_is_killed():
    code = (
        "import time\nfrom surgsim.simulate.ahead import compiling_ahead\n"
        "with compiling_ahead() as told:\n    told(7)\n    print('there', flush=True)\n    time.sleep(60)\n"
    )
    first = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    assert first.stdout.readline() == b"there\n"
    (helper,) = children(first.pid)
    time.sleep(0.5)
    first.send_signal(signal.SIGKILL)
    first.communicate()
    until = time.monotonic() + 30.0
    while Path(f"/proc/{helper}").exists() and "Z" not in words_of(helper, "stat")[2]:
        assert time.monotonic() < until, "the process outlives the one that it works for"
        time.sleep(0.1)
