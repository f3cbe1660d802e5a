"""A controller outside surgsim: the same run as from the inside, and every way of failing has its words."""

import os
import re
import shlex
import signal
import subprocess
import sys
import time

import numpy as np
import outside
import pytest
from batches import short_run

from surgsim.control.external.given_commands import giving
from surgsim.errors import Outcome, SurgsimError
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare

FIXTURE = {"mine": outside.command()}
EXTERNAL = "controller.resolver={type: external}"
SOON = "controller.resolver={type: external, timeout_s: 0.2}"


def children():
    """Processes of this one that are there, zombies too."""
    own = []
    for stat in (int(name) for name in os.listdir("/proc") if name.isdigit()):
        try:
            with open(f"/proc/{stat}/stat", encoding="utf-8") as file:
                if int(file.read().rpartition(")")[2].split()[1]) == os.getpid():
                    own.append(stat)
        except OSError:
            continue
    return own


@pytest.fixture(autouse=True)
def _leaves_nothing():
    before, files = children(), len(os.listdir("/proc/self/fd"))
    yield
    assert children() == before
    assert len(os.listdir("/proc/self/fd")) <= files


def test_the_same_law_outside_gives_the_same_bits(scenario):
    """All but the residual, which an external resolver knows of the bounds alone, and the clock."""
    inside = simulate(scenario(controller="pinv"))
    with giving(FIXTURE):
        made = scenario(EXTERNAL, controller="pinv")
        traces = [simulate(made), simulate(made)]
    assert traces[0].meta.ending.outcome is Outcome.COMPLETED
    names = [name for name in inside.columns if name not in ("control_time_s", "resolver_residual_m_per_s")]
    for name in names:
        np.testing.assert_array_equal(traces[0][name], inside[name], err_msg=name)
    for name in (*names, "resolver_residual_m_per_s"):
        np.testing.assert_array_equal(traces[0][name], traces[1][name], err_msg=name)
    assert np.nanmax(traces[0]["resolver_residual_m_per_s"]) < 1e-15


@pytest.mark.parametrize(
    ("name", "change"),
    [("circle_lwr4plus", "trocar=null"), ("circle_panda", "plant={type: kinematic}")],
)
def test_other_arms_and_plants(name, change):
    settings = [*short_run(0.25), change]
    inside = simulate(load_scenario(name, controller="pinv", assignments=settings))
    with giving(FIXTURE):
        found = simulate(load_scenario(name, controller="pinv", assignments=[*settings, EXTERNAL]))
    np.testing.assert_array_equal(found.block("q"), inside.block("q"))


@pytest.mark.parametrize("bridged", [0, 1])
def test_a_controller_that_gives_up_is_infeasible_or_bridged(scenario, bridged):
    """After a tick without a command it begins anew: requests are counted from 1 again."""
    with giving({"mine": outside.command("gives_up", 50)}):
        trace = simulate(scenario(EXTERNAL, "task.duration_s=0.25", f"safety.infeasible_ticks_max={bridged}"))
    ending = trace.meta.ending
    assert ending.outcome is (Outcome.COMPLETED if bridged else Outcome.INFEASIBLE)
    assert np.flatnonzero(trace.active()["infeasible"]).tolist() == (
        [49, 99, 149, 199, 249] if bridged else [49]
    )


def test_a_run_with_a_process_is_neither_stored_nor_forked(scenario):
    with giving(FIXTURE):
        setup = prepare(scenario(EXTERNAL, controller="pinv"))
        simulation = Simulation(setup)
        simulation.advance(5)
        for ask in (simulation.snapshot, simulation.fork):
            with pytest.raises(SurgsimError, match=r"controller\.resolver: .*in a process of its own"):
                ask()
        setup.controller.close()
        simulation.advance(1)  # its files are closed: nothing is written to whatever has their numbers now
    assert simulation.ending is not None
    assert simulation.ending.outcome is Outcome.EXTERNAL_FAILED


def test_below_a_policy_its_failure_is_its_own(scenario):
    below = "controller.resolver.resolver={type: external, timeout_s: 0.2}"
    with giving({"mine": outside.command("ends", 50)}):
        trace = simulate(scenario(below, controller="policy_proportional"))
    assert trace.meta.ending.outcome is Outcome.EXTERNAL_FAILED
    assert "the watchdog bit" in trace.meta.ending.detail


def test_a_torque_law(scenario):
    """Its rows are the terms of the torque; gravity is added or not."""
    law = "controller.torque_law={type: external, add_bias: ADDED}"
    with giving(FIXTURE):
        for added in ("true", "false"):
            made = scenario(
                law.replace("ADDED", added), "safety.tip_error_max_m=null", "safety.rcm_error_max_m=null"
            )
            trace = simulate(made)
            assert np.nanmax(np.abs(trace["tau_external_1_nm"])) > 0.0
            assert (np.nanmax(np.abs(trace["tau_bias_2_nm"])) > 1.0) == (added == "true")


WORDS = {
    "killed": r"external controller 'mine' was ended by SIGKILL at 0\.049 s",
    "ends": r"external controller 'mine' ended with status 3 at 0\.049 s; its last words: the watchdog bit",
    "closes": r"external controller 'mine' closed its standard output at 0\.049 s",
    "hangs": r"external controller 'mine' did not answer within 0\.2 s at 0\.049 s",
    "stutters": r"external controller 'mine' did not answer within 0\.2 s at 0\.049 s: 24 of 88 bytes .*",
    "garbage": r"external controller 'mine' gave what is no answer at 0\.049 s: 88 of 88 bytes came, .*",
    "short": r"external controller 'mine' did not answer within 0\.2 s at 0\.049 s: \d+ of 88 bytes came, .*",
    "long": r"external controller 'mine' answered with more than 88 bytes at 0\.049 s",
    "late": r"external controller 'mine' answered the request 49, not 50, at 0\.049 s",
    "nan": r"external controller 'mine' gave nan rad/s for joint 2 at 0\.049 s",
    "status": r"external controller 'mine' gave the status 7 at 0\.049 s: 0 is an answer, .*",
}


def test_a_process_that_answers_and_does_not_read_is_not_waited_for(scenario):
    """Requests fill the pipe to it after a while; a write that waits would never end."""
    began = time.monotonic()
    with giving({"mine": outside.command("deaf", 50)}):
        trace = simulate(scenario(SOON, "safety.stop={duration_s: 0.02}"))
    assert time.monotonic() - began < 30.0
    ending = trace.meta.ending
    assert ending.outcome is Outcome.EXTERNAL_FAILED
    assert "external controller 'mine' did not read what it was asked within 0.2 s" in ending.detail
    assert ending.t_s > 0.05


@pytest.mark.parametrize("how", outside.FAILURES)
def test_a_process_that_fails_is_an_outcome_with_its_words(scenario, how):
    with giving({"mine": outside.command(how, 50, 1)}):
        trace = simulate(scenario(SOON, "safety.stop={duration_s: 0.02}"))
    ending = trace.meta.ending
    assert ending.outcome is Outcome.EXTERNAL_FAILED
    assert re.fullmatch(WORDS[how], ending.detail), ending.detail
    assert ending.t_s == pytest.approx(0.049)
    assert len(trace.stop()) > 10  # the arm is stopped and held


def test_ctrl_c_ends_a_run_whose_controller_hangs_and_leaves_nothing(tmp_path):
    """Its time limit is a minute: the signal is not made to wait for that."""
    hung = tmp_path / "hung"
    told = f"import os, runpy, sys; open({str(hung)!r}, 'w').write(str(os.getpid()))"
    program = (
        f"{told}; sys.argv = ['x', 'hangs', '50']; runpy.run_path({outside.__file__!r}, run_name='__main__')"
    )
    long = "controller.torque_law={type: external, timeout_s: 60}"
    words = ["run", "circle_lwr4plus", "--controller", "external_torque", "--set", long, "--no-record"]
    given = f"mine={shlex.join([sys.executable, '-S', '-E', '-c', program])}"
    command = [sys.executable, "-m", "surgsim", *words, "--external", given, "--out", str(tmp_path / "run")]
    run = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60.0
    while not hung.exists() and time.monotonic() < until:
        time.sleep(0.05)
    time.sleep(1.0)
    run.send_signal(signal.SIGINT)
    _, said = run.communicate(timeout=20.0)
    assert run.returncode == 130
    assert "interrupted" in said
    with pytest.raises(ProcessLookupError):
        os.kill(int(hung.read_text(encoding="utf-8")), 0)
    assert not (tmp_path / "run").exists()
