"""Every command of the documents, as a person runs it: in a terminal of 80 columns, to its end.

The commands are read from the fenced `bash` blocks, so that a new one is tested without further edits. What
is shortened, what ends otherwise than with 0, and what cannot be run here is listed below.

A page's first command starts as a person starts it; those after it are forks of a warm process. The first
of a kind on a page is typed in a terminal of 120 columns too, in the same folder, where a batch goes on with
`--resume` and finds its runs. One batch is begun in both, and its report has pictures; others are as where
nothing can be drawn.
"""

import itertools
import re
import shlex
from pathlib import Path

import pytest

from surgsim.metrics.catalog import METRICS
from surgsim.scenario.load import shipped

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    page
    for pattern in ("README.md", "CONTRIBUTING.md", "docs/**/*.md", "benchmarks/*.md")
    for page in ROOT.glob(pattern)
)
WINDOW, PERSON = "opens a window", "needs a person at a window"
INSTALLS, DRAWS = "installs and builds: .ci/run calls it", "draws pictures for minutes"
NOT_HERE = {
    "make run": INSTALLS,
    "make test": INSTALLS,
    "make test-all": INSTALLS,
    "make check": INSTALLS,
    "source .venv/bin/activate": "the tests have an environment already",
    "surgsim run peg_and_ring_panda --operator keyboard": PERSON,
    "surgsim run teleop_wall_panda --operator gamepad --set task.duration_s=300": PERSON,
    "surgsim inspect runs/tilted_circle/vprnn-seed0 --view": WINDOW,
    "surgsim compare full --engine ray --address 10.0.0.1:6379 --out runs/full": "needs a cluster",
    "python docs/images/controllers.py": DRAWS,
    "python docs/images/controllers.py frontier": DRAWS,
    "python docs/images/torque_level.py": DRAWS,
    "surgsim bench --only ticks --against benchmarks/ratios.json": "a measurement of the machine",
    "surgsim bench --only ticks --keep benchmarks/ratios.json": "a measurement of the machine",
}
# What is added to a command so that it ends soon: the same command otherwise.
SHORT = "--set task.duration_s=3.0 --set task.hold_end_s=0.0 --jobs 1"
FEW = f"{SHORT} --controllers vprnn,pinv --seeds 0:1"
FEWEST = f"{SHORT} --controllers pinv --seeds 0:1"
TWO = "surgsim compare circle_lwr4plus --controllers vprnn,joint_impedance --seeds 0:2 --out runs/two"
SHORTER = {
    "surgsim compare quick --out runs/quick": FEW,
    "surgsim compare quick --out runs/quick --resume": FEW,
    "surgsim compare quick --matters rcm_error_rms_mm=0.5 --out runs/half_mm": FEW,
    TWO: f"{SHORT} --jobs 2",
    "surgsim compare circle_lwr4plus spiral_lwr4plus --controllers vprnn,rcm_inverse_dynamics --seeds 0:5": (
        f"{SHORT} --seeds 0:1"
    ),
    "surgsim compare seeds --out runs/seeds --shard 1/2": FEWEST,
    "surgsim compare seeds --out runs/seeds --shard 2/2": FEWEST,
    "surgsim compare seeds --out runs/seeds --resume": FEWEST,
    "surgsim compare circle_lwr4plus --controllers vprnn,policy_proportional": SHORT,
    "surgsim compare circle_lwr4plus --controllers vprnn,pinv --set task.radius_m=0.01 "
    "--out runs/small_circle": SHORT,
    "surgsim compare theatre --out runs/theatre": f"{SHORT} --controllers joint_elastic_dynamics --seeds 0:1",
    "surgsim compare baselines --out runs/baselines": f"{SHORT} --controllers rcm_elastic_dynamics --seeds 0",
    "surgsim compare theatre_ideal --out runs/theatre_ideal": f"{SHORT} --controllers vprnn --seeds 0:2",
    "surgsim compare drives --out runs/drives": "--controllers joint_elastic_dynamics --seeds 0:1",
    "surgsim compare breathing_tracked --out runs/breathing_tracked": f"{SHORT} --controllers vprnn",
    "surgsim compare breathing_hidden --out runs/breathing_hidden": f"{SHORT} --controllers vprnn",
    "surgsim compare robustness --out runs/robustness": "--controllers vprnn --seeds 0:1",
    "surgsim compare circle_lwr4plus --controllers rcm_inverse_dynamics,joint_impedance,vprnn --seeds 0:5 "
    "--set 'disturbances=[{type: calibration_error}]' --out runs/calibration": f"{SHORT} --seeds 0:1",
    "surgsim compare circle_lwr4plus --controllers rcm_inverse_dynamics,rcm_elastic_dynamics,joint_impedance "
    "--seeds 0:1 --set simulation.timestep_s=0.0005 --set 'disturbances=[{type: bending_shaft}]' "
    "--out runs/bending_shaft": SHORT,
    "surgsim compare calibrated_circle_lwr4plus calibrated_circle_panda --seeds 0:10 --out runs/tracked": (
        f"{SHORT} --seeds 0:1"
    ),
    "surgsim compare peg_and_ring --out runs/peg_and_ring": (
        f"{SHORT} --set task.time_limit_s=3.0 --seeds 0:1"
    ),
    "surgsim compare random_lwr4plus random_panda random_fr3 random_iiwa14 --controllers rcm_sliding_mode "
    "--seeds 0:3 --set robot.drive=real --set disturbances.1.coulomb_nm=0.0 "
    "--set controller.torque_law.drive_layer_share=0.6 --out runs/layer": f"{SHORT} --seeds 1",
    "surgsim compare random_lwr4plus random_panda random_fr3 random_iiwa14 --controllers adaptive_decoupling "
    "--seeds 0:3 --set robot.drive=real --set disturbances.1.coulomb_nm=0.0 "
    "--set controller.torque_law.nodes=1 --out runs/one_node": f"{SHORT} --seeds 1",
    "surgsim compare frontier --seeds 0:1 --out runs/frontier": "--controllers rcm_inverse_dynamics",
    "surgsim compare torque_level --out runs/torque_level": "--controllers rcm_inverse_dynamics",
    "surgsim tune joint_impedance --scenario theatre_lwr4plus --budget 60 --out tuned": f"{SHORT} --budget 6",
    "surgsim compare theatre_lwr4plus --controllers joint_impedance,tuned/joint_impedance_tuned.yaml "
    "--seeds 0:3": f"{SHORT} --seeds 0:1",
    "surgsim adopt desk_arm.xml --flange tool "
    "--set 'limits.velocity_rad_per_s=[2, 2, 2, 2, 3, 3, 3]'": "--quick",
    "surgsim export runs/vprnn runs/pinv --video runs.gif --speed 2": "--fps 1 --size 96x64",
    "surgsim bench": "--duration 3",
    "surgsim bench --only ticks,stages --cases circle/vprnn,kinematic/pinv": "--duration 3",
    "surgsim bench --only libraries --json": "--duration 3",
}
SLOW = (
    "surgsim reproduce ",
    "surgsim bench",
    "surgsim compare robustness ",
    "surgsim compare frontier ",
    "surgsim compare torque_level ",
    "surgsim compare drives ",
)
RIGID = (
    "surgsim run circle_panda --controller rcm_inverse_dynamics --set robot.drive=real --out runs/rigid_law"
)
LOST = (
    "surgsim run circle_panda --controller joint_impedance "
    "--set 'disturbances=[{type: late_ticks, probability: 0.003, burst_ticks: 40, stop_after_ticks: 20}]' "
    "--set seed=15 --out runs/lost"
)
NO_PREDICTION = (
    "surgsim run circle_lwr4plus --controller rcm_inverse_dynamics "
    "--set controller.torque_law.rcm_stiffness_per_s2=20000 "
    "--set controller.torque_law.tip_stiffness_per_s2=10000 --set controller.torque_law.observer_gain=0.3 "
    "--set 'disturbances=[{type: actuation_delay, delay_s: 0.004}]' "
    "--set controller.torque_law.most_delay_ticks=0 --out runs/no_prediction"
)
STATUS = {
    RIGID: 1,  # a law that takes the drives for ideal
    LOST: 1,  # twenty commands in a row are lost
    NO_PREDICTION: 1,  # past the frontier: the run is stopped, as the page says
    "surgsim compare seeds --out runs/seeds --shard 1/2": 1,  # the other shard is missing
}


def commands(page):
    """The commands of a page's `bash` blocks, without what is said of them."""
    blocks = re.findall(r"^```bash\n(.*?)^```$", page.read_text(), re.M | re.S)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    words = [shlex.split(line, comments=True) for line in lines]
    return [shlex.join(line) for line in words if line]


def files(page):
    """Name and content of every file that a page tells a reader to save."""
    return re.findall(
        r"^Save this as `([\w.]+)`.*?\n```(?:yaml|xml)\n(.*?)^```$", page.read_text(), re.M | re.S
    )


def plain(command):
    """A command as it is written, whatever its quotes."""
    return shlex.join(shlex.split(command))


LISTED = [*NOT_HERE, *SHORTER, *STATUS]
ALL = {page: commands(page) for page in PAGES}


def test_what_is_listed_is_documented():
    documented = {command for page in ALL.values() for command in page}
    assert [command for command in LISTED if plain(command) not in documented] == []
    assert len(documented) > 40


def cases(slow):
    """(page, commands) to be run one after the other: a page's, or a slow one alone."""
    for page, found in ALL.items():
        here = [command for command in found if command not in NOT_HERE]
        for command in here if slow else ():
            if command.startswith(SLOW):
                yield pytest.param(page, [command], id=command.replace("/", "_"))
        rest = [command for command in here if not command.startswith(SLOW)]
        if rest and not slow:
            drawn = [pytest.mark.needs("opengl")] if any(" --video " in command for command in rest) else []
            yield pytest.param(page, rest, id=str(page.relative_to(ROOT)).replace("/", "_"), marks=drawn)


@pytest.mark.parametrize(("page", "typed"), list(cases(slow=False)))
def test_the_commands_of_a_page(surgsim, tmp_path, page, typed):
    run_all(surgsim, tmp_path, page, typed)


@pytest.mark.slow
@pytest.mark.parametrize(("page", "typed"), list(cases(slow=True)))
def test_a_slow_command(surgsim, tmp_path, page, typed):
    run_all(surgsim, tmp_path, page, typed)


def run_all(surgsim, folder, page, typed):
    """Type the commands, the first of a kind at both widths, and look at each when it has ended."""
    for name, text in files(page):
        (folder / name).write_text(text)
    cold, seen = True, []
    for command in typed:
        kind = kind_of(command)
        widths = (80,) if kind in seen else (80, 120)
        seen.append(kind)
        for columns in widths:
            added = f"{SHORTER.get(command, '')} {again(command) if columns == 120 else ''}"
            variables, (program, *words) = with_variables(shlex.split(f"{command} {added}"))
            assert program == "surgsim", f"list {command} in NOT_HERE with a reason, or run it here"
            draws = "--video" in words
            poor = {} if command == TWO or draws else {"MUJOCO_GL": "disable"}
            done = surgsim(*words, columns=columns, cold=cold or draws, env=poor | variables).wait(
                timeout_s=600.0
            )
            print(f"$ {command} {added}\n{done.text}")
            assert done.status == STATUS.get(command, 0), command
            assert "Traceback" not in done.text
            assert too_wide(done.lines, columns) == []
            assert broken(done.lines) == []
            cold = False


def kind_of(command):
    """What it prints may be laid out alike: the subcommand, what `list` lists, and the options."""
    _, (_, name, *words) = with_variables(shlex.split(command))
    options = {word.partition("=")[0] for word in words if word.startswith("--")} - {"--set", "--out"}
    return name, words[0] if name == "list" else "", options


def with_variables(words):
    """The variables that `env` sets in front of a command, and the command."""
    if words[0] != "env":
        return {}, words
    count = next(i for i, word in enumerate(words[1:], start=1) if "=" not in word)
    return dict(word.split("=", 1) for word in words[1:count]), words[count:]


def again(command):
    """What is added to a command that is typed a second time in its folder."""
    if command == TWO:
        return "--out runs/two_wide"
    if command.startswith("surgsim export "):
        return "--force"
    return "--resume" if command.startswith(("surgsim compare ", "surgsim tune ")) else ""


def too_wide(lines, columns):
    """Lines that a terminal would break; a single word, such as a path, may be longer than it is wide."""
    return [line for line in lines if len(line) > columns and " " in line.strip()]


NAMES = {*METRICS, *shipped(), *shipped("controllers"), *shipped("suites")}


def broken(lines):
    """Names that stand partly at a line's end and partly at the next one's start."""
    found = []
    for above, below in itertools.pairwise(lines):
        start, end = above.split()[-1], below.split()[0]
        if start + end in NAMES and start not in NAMES:
            found.append((above, below))
    return found


def test_commands_of_one_kind_have_the_same_options():
    one, other = (kind_of(f"surgsim export runs/{name} --figure {name}.pdf") for name in "ab")
    assert one == other
    assert kind_of("env A=1 surgsim run x --set a=1 --out y") == kind_of("surgsim run z")
    for words in ("export runs/a --table a.md", "list robots", "list suites", "run x --live"):
        assert kind_of(f"surgsim {words}") not in (
            one,
            kind_of("surgsim list tasks"),
            kind_of("surgsim run x"),
        )


def test_the_checks_above_catch_what_they_should():
    assert too_wide(["x " * 41], 80)
    assert not too_wide(["x" * 200, "x " * 40 + "x"], 81)
    assert broken(["12.5  rcm_error_", "rms_mm  x"])
    assert not broken(["12.5  rcm_error_rms_mm", "rcm_error_max_mm"])
