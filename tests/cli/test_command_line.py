"""The real command line in subprocesses: exit status, what is on stdout, one-line errors."""

import json
import os
import re
import subprocess
import sys

import pytest

from surgsim.bench.cases import NEEDS
from surgsim.cli.list import KINDS
from surgsim.cli.main import COMMANDS, main
from surgsim.scenario.load import load_experiment, load_scenario, of_one_arm, shipped
from surgsim.simulate.setup import prepare
from surgsim.tasks.base import PathTaskConfig

HEAVY = ("mujoco", "numpy", "scipy", "mink", "rerun", "pydantic", "numba", "qpsolvers", "pyarrow", "rich")
SHORT = ["task.duration_s=0.3", "task.ramp_s=0.15", "task.hold_start_s=0", "task.hold_end_s=0"]
SLOW_LIMITS = [
    "safety.stop_at_velocity_limit=false",
    "safety.stop_at_collision=false",
    "safety.rcm_error_max_m=null",
]


COLD = ("circle_lwr4plus", "peg_and_ring_panda")
"""Scenarios that are run by a process that has to start first, as a person's does."""


@pytest.fixture
def surgsim(warm, tmp_path):
    """Runs a command in an empty folder, without colours: as a fork of a warm process, or `cold`."""

    def run(*words, cold=False):
        if not cold:
            return warm.run(words, tmp_path, NO_COLOR="1")
        command = [sys.executable, "-W", "error", "-m", "surgsim", *words]
        environment = {**os.environ, "NO_COLOR": "1"}
        return subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=100
        )

    return run


def _set(*assignments):
    return [word for assignment in assignments for word in ("--set", assignment)]


ARMS = sorted(set(shipped()) - set(of_one_arm(shipped())))
OF_EACH = [f"arms.{k}.{key}" for k in (0, 1) for key in SHORT]


@pytest.mark.parametrize("name", ARMS)
def test_every_shipped_scenario_of_several_arms_runs(surgsim, name, tmp_path):
    done = surgsim("run", name, "--no-record", "--json", "--out", "run", *_set(*OF_EACH, *SLOW_LIMITS))
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["scenario"], summary["outcome"]["name"]) == (name, "completed")
    assert sorted(summary["arms"]) == sorted(load_experiment(name).names)
    assert json.loads((tmp_path / "run" / "metrics.json").read_text()) == summary


@pytest.mark.parametrize("name", of_one_arm(shipped()))
def test_every_shipped_scenario_runs(surgsim, name, tmp_path):
    path = isinstance(load_scenario(name).task, PathTaskConfig)
    short = SHORT if path else SHORT[:1]
    if "human_push" in name:  # which begins after the end of a run cut short
        short = (*short, "disturbances=[]")
    if "guidance" in name:
        short = (*short, *NEEDS["hands_on_admittance"])
    if load_scenario(name).robot.drives is not None:  # no elastic gear follows such a circle in 0.3 s
        short = (*short, "task.radius_m=0.002")
    cold = name in COLD
    done = surgsim(
        "run", name, "--no-record", "--json", "--out", "run", *_set(*short, *SLOW_LIMITS), cold=cold
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["scenario"], summary["outcome"]["name"]) == (name, "completed")
    last = prepare(load_scenario(name, assignments=[*short, *SLOW_LIMITS])).task.duration_s
    assert summary["outcome"]["t_s"] == pytest.approx(last)
    assert json.loads((tmp_path / "run" / "metrics.json").read_text()) == summary
    said = re.sub(r"(?m)^compil(ing|ed) .*\n", "", done.stderr)  # where kernels are new
    assert re.search(rf"(^|\n)simulated {last:.1f} s [^\n]* real time[^\n]*; wrote run\n$", said)


def test_a_run_that_ends_early_exits_1_and_is_written_all_the_same(surgsim, tmp_path):
    done = surgsim("run", "circle_lwr4plus", "--no-record", *_set(*SHORT, "safety.tip_error_max_m=1e-9"))
    assert done.returncode == 1
    assert "tip_limit at 0.00" in done.stdout
    assert "The tip left its path by more than the stated limit (tip 0.00 mm from its command" in done.stdout
    summary = json.loads((tmp_path / "runs/circle_lwr4plus/vprnn-seed0/metrics.json").read_text())
    assert summary["outcome"]["name"] == "tip_limit"


def _one_line(done):
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"surgsim: [^\n]+\n", done.stderr), done.stderr
    return done.stderr.removeprefix("surgsim: ").rstrip("\n")


WRONG = {
    "unknown scenario": (["run", "circel_lwr4plus"], "'circel_lwr4plus' is not a shipped scenario. Known: "),
    "unknown safety scenario": (
        ["run", "safety/tip_limt"],
        "'safety/tip_limt' is not a shipped scenario. Known: safety/acceleration_discontinuity, ",
    ),
    "unknown controller": (
        ["run", "circle_lwr4plus", "--controller", "vprn"],
        "--controller: 'vprn' is not a ",
    ),
    "no such file": (["check", "nothing.yaml"], "nothing.yaml: "),
    "bad value": (
        ["run", "circle_lwr4plus", "--set", "task.radius_m=-1"],
        "--set task.radius_m=-1: task.radius_m: -1 is not allowed: must be greater than 0",
    ),
    "bad key": (
        ["run", "circle_lwr4plus", "--set", "task.radios_m=1"],
        "--set task.radios_m=1: task.radios_m: unknown key",
    ),
    "bad seed": (
        ["run", "circle_lwr4plus", "--seed", "-1"],
        "--seed: -1 is not allowed: must be 0 or more",
    ),
    "out of reach": (
        ["run", "circle_lwr4plus", "--set", "task.radius_m=0.2"],
        "circle_lwr4plus: at t = ",
    ),
    "foreign folder": (["run", "circle_lwr4plus", "--out", "."], ". holds 'other.txt', which is not a run's"),
    "nothing recorded": (["inspect", "nowhere"], "nowhere"),
    "bad bench": (["bench", "--duration", "0"], "bench needs a duration of at least 3 s"),
}


@pytest.mark.parametrize("name", ["unknown scenario", "out of reach", "foreign folder"])
def test_what_the_user_can_mend_is_one_line_and_exit_2(surgsim, name, tmp_path):
    (tmp_path / "other.txt").write_text("")
    words, text = WRONG[name]
    assert text in _one_line(surgsim(*words, cold=True))


@pytest.mark.parametrize("name", WRONG)
def test_what_the_user_can_mend_in_process(capsys, monkeypatch, tmp_path, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other.txt").write_text("")
    words, text = WRONG[name]
    assert main(words) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert error.startswith("surgsim: ")
    assert error.count("\n") == 1
    assert text in error


@pytest.mark.parametrize("words", [[], ["fly"], ["run"], ["list", "planets"], ["run", "x", "--speed", "9"]])
def test_a_wrong_command_exits_2_with_the_usage(capsys, words):
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert error.startswith("usage: surgsim")


MISTYPED = {
    "command": (["rnu"], "'rnu' is not a command. Known: adopt, bench, check, "),
    "kind": (["list", "controler"], "'controler' is not a kind. Known: bilateral, "),
    "option": (
        ["run", "circle_lwr4plus", "--contrller", "qp"],
        "'--contrller' is not an option of surgsim run.",
    ),
    "value": (
        ["compare", "quick", "--engine", "locla"],
        "'locla' is not a value of --engine. Known: local, ray.",
    ),
}
MEANT = {"command": "run", "kind": "controllers", "option": "--controller", "value": "local"}


@pytest.mark.parametrize("what", MISTYPED)
def test_a_mistyped_word_is_met_with_help_and_what_was_meant(capsys, what):
    words, text = MISTYPED[what]
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    out, error = capsys.readouterr()
    assert out == ""
    last = error.splitlines()[-1]
    assert last.startswith(f"surgsim: {text}")
    assert last.endswith(f" Did you mean '{MEANT[what]}'?")
    assert ("examples:" in error) == (what in ("command", "kind")), "the whole help, or the usage"


@pytest.mark.parametrize(
    ("words", "missing"),
    [([], "COMMAND"), (["list"], "KIND"), (["run"], "SCENARIO"), (["compare"], "SUITE|")],
)
def test_a_bare_command_shows_its_help(capsys, words, missing):
    with pytest.raises(SystemExit):
        main(words)
    error = capsys.readouterr().err
    assert error.splitlines()[-1].startswith(f"surgsim: {missing}")
    assert error.splitlines()[-1].endswith(" is missing")
    assert "examples:" in error


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_help_goes_to_stdout_with_examples(capsys, command):
    with pytest.raises(SystemExit) as ended:
        main([*([command] if command else []), "--help"])
    assert ended.value.code == 0
    out, error = capsys.readouterr()
    assert error == ""
    assert f"usage: surgsim {command}".rstrip() in out
    assert f"  surgsim {command}" in out.split("examples:")[1]


def test_help_through_the_installed_command_imports_nothing_heavy():
    code = (
        "import sys, surgsim.cli.main as m; m.build_parser().format_help(); "
        f"print([name for name in {HEAVY} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "[]\n"), done.stderr


@pytest.mark.parametrize("kind", KINDS)
def test_list_prints_names_with_descriptions(capsys, kind):
    assert main(["list", kind, "--json"]) == 0
    items = json.loads(capsys.readouterr().out)
    assert all(set(item) == {"name", "description"} for item in items)
    names = [item["name"] for item in items]
    assert len(set(names)) == len(names)
    assert names
    assert kind == "suites" or all(item["description"] for item in items)
    assert main(["list", kind]) == 0
    table = capsys.readouterr().out
    assert table.split("\n")[0].rstrip() == f"{len(items)} {kind}"
    assert all(name in table for name in names)


@pytest.mark.parametrize(
    ("kind", "some"),
    [
        ("scenarios", {"circle_lwr4plus", "sinusoid_lwr4plus", "spiral_lwr4plus", "safety/tip_limit"}),
        ("policies", {"damping", "proportional"}),
        ("plants", {"dynamic", "kinematic"}),
        ("controllers", {"vprnn"}),
        ("robots", {"lwr4plus"}),
        ("instruments", {"endoscope_0", "endoscope_30", "hook_30"}),
        ("tasks", {"circle", "sinusoid", "spiral"}),
        ("resolvers", {"vprnn"}),
        ("torque-laws", {"hierarchical_impedance"}),
        ("port-estimators", {"tracking", "interaction_force"}),
        ("instrument-estimators", {"nominal", "tracked"}),
        ("props", {"peg_board", "contact_wall"}),
        ("bilateral", {"passive_convex", "wave_variables"}),
        ("disturbances", {"payload"}),
        ("metrics", {"tip_error_rms_mm", "rcm_error_max_mm", "sparc", "control_time_p99_us"}),
    ],
)
def test_list_holds_what_is_shipped(capsys, kind, some):
    main(["list", kind, "--json"])
    assert some <= {item["name"] for item in json.loads(capsys.readouterr().out)}


def test_check_prints_the_resolved_scenario_which_is_the_same_scenario(capsys, tmp_path):
    changes = _set("task.radius_m=0.03", "theatre=false")
    assert main(["check", "circle_lwr4plus", "--seed", "4", *changes]) == 0
    out, error = capsys.readouterr()
    assert error == ""
    resolved = tmp_path / "resolved.yaml"
    resolved.write_text(out)
    scenario = load_scenario(str(resolved))
    assert (scenario.seed, scenario.task.radius_m) == (4, 0.03)
    assert re.match(rf"# circle_lwr4plus: ok, 11 s\n# sha256 {scenario.sha256()}\n", out)


def test_check_looks_at_every_scenario_and_exits_2_if_any_is_wrong(capsys):
    assert main(["check", "nothing.yaml", "circle_lwr4plus", *_set("theatre=false")]) == 2
    out, error = capsys.readouterr()
    assert "# circle_lwr4plus: ok" in out
    assert error.startswith("surgsim: nothing.yaml")
    assert main(["check", "circle_lwr4plus", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_version(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert re.fullmatch(r"surgsim \d+\.\d+.*\n", capsys.readouterr().out)


@pytest.mark.parametrize("name", sorted(set(shipped("controllers")) - {"vprnn"}))
def test_every_shipped_controller_runs_the_circle(capsys, monkeypatch, tmp_path, name):
    monkeypatch.chdir(tmp_path)
    words = ["run", "circle_lwr4plus", "--controller", name, "--no-record", "--json"]
    wall = NEEDS.get(name, ())
    assert main([*words, *_set(*SHORT, *SLOW_LIMITS, *wall, "theatre=false", "task.radius_m=0.002")]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["controller"], summary["outcome"]["name"]) == (name, "completed")
    assert (tmp_path / "runs" / "circle_lwr4plus" / f"{name}-seed0" / "metrics.json").is_file()
