"""What is exchanged: the layout in JSON and in C, what stands in a request, and what is refused."""

import json
import re
import shutil
import struct
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import outside
import pytest

from surgsim.cli.main import main
from surgsim.control.external.command import Function, Program, read_command
from surgsim.control.external.exchange import exchange
from surgsim.control.external.given_commands import command_for, given, giving, parse_given
from surgsim.control.external.layout import JOINT_VELOCITY, layout_hash, request, runs
from surgsim.control.external.outside import Outside
from surgsim.control.external.texts import header_text, layout_json
from surgsim.control.seen import new_seen
from surgsim.errors import Outcome, SurgsimError
from surgsim.scenario.externals import configured
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare
from surgsim.tick.arrays import Seen, new
from surgsim.tick.fields import fields_of
from surgsim.tick.status import GOES_ON

EXAMPLES = Path(__file__).parents[3] / "examples" / "external"


def test_every_field_that_a_part_sees_is_in_the_request_and_explained():
    named = {field.name: field for field in request().fields}
    assert set(named) == {*fields_of(new(Seen, 7)), "magic", "tick", "n"}
    assert [field.name for field in request().fields if len(field.meaning) < 3] == []
    assert (named["M"].unit, named["M"].shown, named["M"].shape) == ("kg m^2", "n n", (8, 8))
    assert named["Jv_WT"].meaning == "Translational tip Jacobian"


@pytest.mark.parametrize("n", [6, 7, 8])
def test_a_request_holds_what_is_seen(n):
    """Against a copy field by field, for a record filled with different numbers."""
    seen, wanted = new(Seen, n), np.zeros(1, request().dtype)[0]
    words = np.asarray(seen.base).view(np.float64)
    words[:] = np.arange(words.size) + 0.5
    for name, value in fields_of(seen).items():
        if np.ndim(wanted[name]):
            wanted[name][tuple(slice(size) for size in value.shape)] = value
        else:
            wanted[name] = value[0]
    assert {seen.t_s, seen.q[0], seen.q_ref[n - 1]} <= set(words.tolist())  # numbers that tell them apart
    found = np.zeros(request().dtype.itemsize // 8)
    for at, to, count in runs(n):
        found[to : to + count] = words[at : at + count]
    assert found.tobytes() == wanted.tobytes()


def test_the_example_s_layout_and_header_are_those_of_this_version(capsys):
    assert json.loads((EXAMPLES / "python" / "layout.json").read_text(encoding="utf-8")) == layout_json()
    assert (EXAMPLES / "c" / "surgsim_external.h").read_text(encoding="utf-8") == header_text()
    assert main(["external", "header"]) == 0
    assert capsys.readouterr().out == header_text()
    assert main(["external", "layout"]) == 0
    assert json.loads(capsys.readouterr().out)["hash"] == layout_hash()


def test_the_offsets_in_json_are_those_of_numpy_and_of_struct():
    for message in layout_json()["messages"].values():
        end = 0
        for field in message["fields"]:
            assert field["offset"] == end
            kind = {"f8": "d", "i8": "q", "S64": "64s"}[field["type"]]
            end += struct.calcsize("<" + kind) * int(np.prod(field["shape"]))
        assert end == message["bytes"]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = tmp_path_factory.mktemp("build")
    strict = "-O2 -Wall -Wextra -Werror"
    done = subprocess.run(
        ["make", "-s", "-C", EXAMPLES / "c", f"BUILD={folder}", f"CFLAGS={strict}"],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.needs("compiler")
def test_the_structs_of_the_header_have_the_offsets_of_the_json(tmp_path):
    lines = [
        f'printf("%zu ", offsetof(surgsim_{name}, {field["name"]}));'
        for name, message in layout_json()["messages"].items()
        for field in message["fields"]
    ]
    source = tmp_path / "offsets.c"
    head = '#include <stdio.h>\n#include <stddef.h>\n#include "surgsim_external.h"\n'
    source.write_text(f"{head}int main(void) {{ {' '.join(lines)} return 0; }}", encoding="utf-8")
    subprocess.run(["cc", "-I", EXAMPLES / "c", "-o", tmp_path / "offsets", source], check=True)
    said = subprocess.run([tmp_path / "offsets"], capture_output=True, text=True, check=True).stdout
    offsets = [
        field["offset"] for message in layout_json()["messages"].values() for field in message["fields"]
    ]
    assert [int(word) for word in said.split()] == offsets


@pytest.mark.needs("compiler")
def test_the_example_in_c_is_pinv_as_a_process_and_as_a_function(built, scenario):
    traces = [simulate(scenario(controller="pinv"))]
    for command in (f"{built}/velocity", f"{built}/libexample.so:velocity"):
        with giving({"mine": command}):
            traces.append(simulate(scenario("controller.resolver={type: external}", controller="pinv")))
    for trace in traces[1:]:
        np.testing.assert_array_equal(trace.block("q"), traces[0].block("q"))


@pytest.mark.needs("compiler")
def test_a_function_s_memory_is_in_snapshots_and_a_process_begins_with_its_own(built, scenario):
    """The torque example integrates: a fork that lost the integral would go another way."""
    made = scenario("disturbances=[{type: payload}]", controller="external_torque")
    with giving({"mine": f"{built}/libexample.so:torque"}):
        simulation = Simulation(prepare(made))
        simulation.advance(100)
        fork, taken = simulation.fork(), simulation.snapshot()
        simulation.advance(100)
        expected = simulation.trace()
        fork.advance(100)
        np.testing.assert_array_equal(fork.trace().block("q"), expected.block("q"))
        simulation.restore(taken)
        simulation.advance(100)
        np.testing.assert_array_equal(simulation.trace().block("q"), expected.block("q"))
    with giving({"mine": f"{built}/torque"}):
        process = simulate(made)
    np.testing.assert_array_equal(process.block("q")[:200], expected.block("q")[:200])


@pytest.mark.needs("compiler")
def test_a_library_that_does_not_fit_is_refused(built, arm):
    for command, words in (
        (f"{built}/libexample.so:nothing", "needs the functions nothing and nothing_declare"),
        (f"{built}/libexample.so:torque", "refuses the arm: its declaration returned 1"),
        (f"{built}/nowhere.so:torque", "cannot be loaded"),
    ):
        with giving({"mine": command}), pytest.raises(SurgsimError, match=words):
            Outside("mine", arm, JOINT_VELOCITY, timeout_s=0.2, start_timeout_s=5.0)


def test_the_function_without_its_decorator_asks_the_same(arm):
    """What the compiled exchange sends, the Python form sends too, and reads the same answer."""
    seen = new_seen(arm, dt_s=0.001, has_trocar=False)
    kin = arm.kinematics(0.5 * (arm.limits.q_min + arm.limits.q_max) + 0.3)
    seen.Jv_WT[:], seen.p_WT[:], seen.v_WTd[:] = kin.Jv_WT, kin.p_WT, [0.01, 0.02, -0.01]
    with giving({"mine": outside.command()}):
        one = Outside("mine", arm, JOINT_VELOCITY, timeout_s=0.5, start_timeout_s=10.0)
    answers = []
    for ask in (exchange, exchange.py_func):
        memory, out = np.zeros(one.memory_size), np.zeros(7)
        assert ask(one.gains, seen, memory, out) == GOES_ON
        answers.append(out)
    one.close()
    np.testing.assert_array_equal(*answers)
    np.testing.assert_allclose(kin.Jv_WT @ answers[0], seen.v_WTd - 5.0 * seen.p_WT, atol=1e-9)


def test_the_example_in_python_is_pinv_and_fails_when_it_is_told_to(scenario):
    program = f"{sys.executable} {EXAMPLES / 'python' / 'controller.py'}"
    made = scenario("controller.resolver={type: external}", controller="pinv")
    with giving({"mine": program}):
        found, inside = simulate(made), simulate(scenario(controller="pinv"))
    np.testing.assert_allclose(found.block("q"), inside.block("q"), atol=1e-9)
    with giving({"mine": f"{program} --dies-at 0.1"}):
        ending = simulate(made).meta.ending
    assert ending.outcome is Outcome.EXTERNAL_FAILED
    assert ending.detail.endswith("at 0.100 s; its last words: the controller dies, as it was told to")


@pytest.mark.needs("compiler")
def test_what_the_page_says_is_true(scenario, tmp_path):
    """Its programs in C and in Python, and its function, are one controller: the same trace of each."""
    page = (EXAMPLES.parents[1] / "docs" / "external_controllers.md").read_text(encoding="utf-8")
    program, declares = (
        textwrap.dedent(code) for code in re.findall(r"^ *```c\n(.*?)^ *```$", page, re.M | re.S)
    )
    python = re.search(r"^```text\n(from surgsim_external .*?)^```$", page, re.M | re.S)[1]
    (tmp_path / "surgsim_external.h").write_text(header_text(), encoding="utf-8")
    (tmp_path / "mine.c").write_text(program, encoding="utf-8")
    (tmp_path / "library.c").write_text(program.replace("static ", "") + declares, encoding="utf-8")
    (tmp_path / "mine.py").write_text(python, encoding="utf-8")
    for name in ("surgsim_external.py", "layout.json"):
        shutil.copy(EXAMPLES / "python" / name, tmp_path)
    subprocess.run(["cc", "-O2", "-o", "mine", "mine.c"], cwd=tmp_path, check=True)
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", "mine.so", "library.c"], cwd=tmp_path, check=True)
    traces = []
    for command in ("mine", "mine.so:follow", "mine.py"):
        start = f"{sys.executable} " if command.endswith(".py") else ""
        with giving({"mine": f"{start}{tmp_path / command}"}):
            traces.append(simulate(scenario(controller="external_torque")))
    assert traces[0].meta.ending.outcome is Outcome.COMPLETED
    for trace in traces[1:]:
        np.testing.assert_allclose(trace.block("q"), traces[0].block("q"), rtol=0.0, atol=1e-12)


REFUSED = {
    "dies": (
        "ended with status 1 before it declared itself; its last words: oh no",
        "import sys; sys.exit('oh no')",
    ),
    "speaks": ("is no controller: it began with b'hello", "print('hello ' * 60, flush=True); input()"),
    "silent": (r"did not declare itself within 0\.3 s: it said nothing", "import time; time.sleep(60)"),
}


@pytest.mark.parametrize("code", REFUSED)
def test_a_program_that_does_not_declare_itself_is_refused(arm, code):
    words, program = REFUSED[code]
    with giving({"mine": f'{sys.executable} -S -E -c "{program}"'}), pytest.raises(SurgsimError, match=words):
        Outside("mine", arm, JOINT_VELOCITY, timeout_s=0.2, start_timeout_s=0.3)


def test_a_program_that_declares_itself_and_reads_no_further_is_refused(arm, monkeypatch):
    """A pipe holds less than the description of the arm: the next request would be read as its rest."""
    layout = layout_json()
    told = struct.pack(
        "<4q64s64s", layout["messages"]["declaration"]["magic"], 1, layout["hash"], 0, b"deaf", b"0"
    )
    program = f"import os, time; os.write(1, bytes.fromhex('{told.hex()}')); time.sleep(60)"
    monkeypatch.setattr("surgsim.control.external.greeting.mjcf_of", lambda _: "x" * 200_000)
    words = r"did not read the description of the arm within 0\.5 s"
    with (
        giving({"mine": f'{sys.executable} -S -E -c "{program}"'}),
        pytest.raises(SurgsimError, match=words),
    ):
        Outside("mine", arm, JOINT_VELOCITY, timeout_s=0.2, start_timeout_s=0.5)


def test_a_program_of_another_layout_is_told_what_to_do(arm, tmp_path):
    layout = layout_json()
    told = struct.pack("<4q64s64s", layout["messages"]["declaration"]["magic"], 1, 12345, 0, b"old", b"0")
    (tmp_path / "old").write_bytes(told)
    with (
        giving({"mine": f"cat {tmp_path / 'old'}"}),
        pytest.raises(SurgsimError, match="`surgsim external header`"),
    ):
        Outside("mine", arm, JOINT_VELOCITY, timeout_s=0.2, start_timeout_s=5.0)


def test_what_a_command_is():
    assert read_command("a", "./my program --gain 3") == Program(words=("./my", "program", "--gain", "3"))
    assert read_command("a", "'./my program'") == Program(words=("./my program",))
    assert read_command("a", "/x/lib.so.2:f") == Function(file=Path("/x/lib.so.2"), name="f")
    assert read_command("a", "lib.so:f") == Function(file=Path("lib.so").absolute(), name="f")
    with pytest.raises(SurgsimError, match="cannot be read: No closing quotation"):
        read_command("a", "it's")


def test_how_commands_are_given():
    assert parse_given(["a=./x --y=1", "b = z"]) == {"a": "./x --y=1", "b": "z"}
    for texts, words in (
        (["mine"], "'mine' is not NAME=COMMAND"),
        (["=x"], "the name '' must be"),
        (["a=x", "a=y"], "'a' is given twice"),
    ):
        with pytest.raises(SurgsimError, match=words):
            parse_given(texts)
    with giving({"a": "x"}), giving({"b": "y"}):
        assert {("a", "x"), ("b", "y")} <= set(given())
        with pytest.raises(SurgsimError, match=r"'c' has no command: give --external c=COMMAND, or the line"):
            command_for("c")
    assert not {("a", "x"), ("b", "y")} & set(given())


def test_the_user_s_own_file(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert configured() == {}
    file = tmp_path / "surgsim" / "external.yaml"
    file.parent.mkdir()
    file.write_text("mine: /opt/lab/controller --fast\n", encoding="utf-8")
    assert configured() == {"mine": "/opt/lab/controller --fast"}
    file.write_text("mine: [a, b]\n", encoding="utf-8")
    with pytest.raises(SurgsimError, match=r"external\.yaml: mine: .* is no command"):
        configured()
