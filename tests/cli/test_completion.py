"""The Tab key: what can come next, and the scripts of the shells."""

import os
import shlex
import shutil
import sys

import pytest

from surgsim.cli.candidates import candidates
from surgsim.cli.completion import SCRIPTS
from surgsim.cli.list import KINDS
from surgsim.cli.main import COMMANDS, build_parser, main
from surgsim.scenario.load import shipped, shipped_safety

NEXT = {
    "": list(COMMANDS),
    "re": ["report", "reproduce"],
    "run circle_": ["circle_fr3", "circle_iiwa14", "circle_lwr4plus", "circle_panda"],
    "run safety/t": ["safety/time_limit", "safety/tip_limit", "safety/torque_rate_limit"],
    "run circle_panda --co": ["--controller"],
    "run circle_panda --controller p": [
        "passive_convex",
        "passive_elastic",
        "passive_kinetic",
        "pinv",
        "policy_proportional",
        "projected_jacobian",
    ],
    "run --controller=pi": ["--controller=pinv"],
    "compare qui": ["quick"],
    "compare quick --controllers vprnn,pi": ["vprnn,pinv"],
    "compare quick --engine ": ["local", "ray"],
    "tune rcm_i": ["rcm_interaction_force", "rcm_inverse_dynamics"],
    "tune pinv --scenario theatre_p": ["theatre_panda"],
    "score rcm_i": ["rcm_interaction_force", "rcm_inverse_dynamics"],
    "seeds ": ["commit", "open", "show"],
    "protocol ": ["show", "check", "freeze"],
    "list to": ["torque-laws"],
    "ex": ["export", "external"],
    "export runs/one --action t": ["tip_velocity", "torque"],
    "export runs/one --width ": ["column", "page"],
    "reproduce vp": ["vprnn"],
    "completion ": list(SCRIPTS),
    "run circle_panda --out ": [],
    "fly ": [],
}


@pytest.mark.parametrize("typed", NEXT)
def test_what_can_come_next(typed):
    words = typed.split(" ")
    assert [word for word, _ in candidates(build_parser(), words)] == NEXT[typed]


def test_every_shipped_name_is_offered():
    offered = {
        words: {word for word, _ in candidates(build_parser(), words.split(" "))}
        for words in ("compare ", "run x --controller ", "list ")
    }
    assert offered["compare "] == {*shipped(), *shipped("suites"), *shipped_safety()}
    assert offered["run x --controller "] == set(shipped("controllers"))
    assert offered["list "] == set(KINDS)


def test_a_shell_that_is_not_known_is_refused(capsys):
    assert main(["completion", "fihs"]) == 2
    assert capsys.readouterr().err == (
        "surgsim: 'fihs' is not a shell. Known: bash, fish, zsh. Did you mean 'fish'?\n"
    )
    assert main(["completion"]) == 2
    assert capsys.readouterr().err == "surgsim: SHELL is missing: bash, zsh, fish\n"


def test_bash_completes(terminal, tmp_path):
    """In the shell itself, by the Tab key."""
    program = tmp_path / "bin" / "surgsim"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m surgsim "$@"\n')
    program.chmod(0o755)
    (tmp_path / "my_scenario.yaml").write_text("")
    path = f"{program.parent}:{os.environ['PATH']}"
    bash = terminal(shutil.which("bash"), "--norc", "-i", columns=200, env={"PATH": path, "PS1": "> "})
    bash.press(b'eval "$(surgsim completion bash)"; echo re"ady"\n')
    bash.wait(until=lambda: "ready\n" in bash.text and bash.text.endswith("> "))
    for keys, shown in (
        (b"surgsim compa\t", "surgsim compare "),
        (b"qui\t", "surgsim compare quick "),
        (b"--controllers vprnn,pi\t", "--controllers vprnn,pinv "),
        (b"--out my_s\t", "--out my_scenario.yaml "),
    ):
        bash.press(keys)
        bash.wait(until=lambda shown=shown: shown in bash.text, timeout_s=60)


def test_a_shell_that_has_ended_is_not_waited_for_as_if_it_had_answered(terminal):
    with pytest.raises(AssertionError, match="it has ended before"):
        terminal(shutil.which("true")).wait(until=lambda: False)
