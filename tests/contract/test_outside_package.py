"""`surgsim test-part` on a package of somebody else's, with good and bad parts of every kind."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from angled import HOOK

from surgsim.plugins import GROUPS

GOOD = '''
"""Parts that keep their promises."""
from typing import Literal
from surgsim.control.instrument_estimators.tracked import TrackedInstrumentConfig
from surgsim.control.port_estimators.tracking import TrackingConfig
from surgsim.control.resolvers.pinv import PinvConfig
from surgsim.control.torque_laws.joint_impedance import JointImpedanceConfig
from surgsim.metrics.metric import Metric
from surgsim.plant.disturbances.payload import PayloadConfig
from surgsim.plant.dynamic import DynamicPlantConfig
from surgsim.plant.props.contact_wall import ContactWallConfig
from surgsim.tasks.circle import CircleConfig
from surgsim.teleop.bilateral.position_position import PositionPositionConfig

class Resolver(PinvConfig):
    """A resolver of somebody else's."""
    type: Literal["my_resolver"] = "my_resolver"

class Law(JointImpedanceConfig):
    """A torque law of somebody else's."""
    type: Literal["my_law"] = "my_law"

class Estimator(TrackingConfig):
    """A port estimator of somebody else's."""
    type: Literal["my_estimator"] = "my_estimator"

class Instrument(TrackedInstrumentConfig):
    """An instrument estimator of somebody else's."""
    type: Literal["my_instrument"] = "my_instrument"

class Task(CircleConfig):
    """A task of somebody else's."""
    type: Literal["my_task"] = "my_task"

class Disturbance(PayloadConfig):
    """A disturbance of somebody else's."""
    type: Literal["my_disturbance"] = "my_disturbance"

class Prop(ContactWallConfig):
    """A prop of somebody else's."""
    type: Literal["my_prop"] = "my_prop"

class Plant(DynamicPlantConfig):
    """A plant of somebody else's."""
    type: Literal["my_plant"] = "my_plant"

class Scheme(PositionPositionConfig):
    """A bilateral scheme of somebody else's."""
    type: Literal["my_scheme"] = "my_scheme"

def policy(observation):
    """Go where the command goes."""
    return observation["command_velocity"].copy()

metric = Metric(
    name="my_metric",
    heading="rows",
    meaning="number of control ticks of the run",
    compute=lambda trace: float(len(trace)),
)
'''
BAD = '''
"""Parts that break a promise each."""
import random
from dataclasses import replace
from typing import Literal
import numpy as np
from surgsim.catalog import PartConfig
from surgsim.control.problem import Resolution
from surgsim.metrics.metric import Metric
from surgsim.plant.part import PlantPart
from surgsim.tasks.base import TimedTask, TipCommand

class Resolver(PartConfig):
    """Faster than the arm can go."""
    type: Literal["bad_resolver"] = "bad_resolver"
    def build(self, arm): return self
    def start(self, problem): return None
    def step(self, problem, memory):
        return Resolution(qdot=np.full_like(problem.q, 100.0), residual=0.0), None

class Law(PartConfig):
    """Another torque each time."""
    type: Literal["bad_law"] = "bad_law"
    def build(self, arm): return Chance()

class Chance:
    terms = ("chance",)
    def start(self, problem): return None
    def torque(self, problem, memory): return np.full((1, problem.q.size), random.random()), None

class Estimator(PartConfig):
    """Sees the trocar beside where it is."""
    type: Literal["bad_estimator"] = "bad_estimator"
    def build(self, arm): return self
    def start(self, problem): return None
    def step(self, problem, memory):
        from types import SimpleNamespace
        zero = np.zeros(3)
        return SimpleNamespace(p_WC=problem.p_WC + 0.01, v_WC=zero, a_WC=zero), None

class Instrument(PartConfig):
    """Corrects without having seen anything."""
    type: Literal["bad_instrument"] = "bad_instrument"
    def build(self, arm): return self
    def start(self, problem): return None
    def step(self, problem, memory):
        from types import SimpleNamespace
        return SimpleNamespace(linear=np.full(3, 1e-4), angular=np.zeros(3)), None

class Task(PartConfig):
    """Sends the tip to no number."""
    type: Literal["bad_task"] = "bad_task"
    start_m: tuple[float, float, float] | None = None
    def build(self, start, period_s=0.001, seed=None): return Nowhere()

class Nowhere(TimedTask):
    duration_s = 1.0
    def command(self, t_s, feedback=None):
        nan = np.full(3, np.nan)
        return TipCommand(p_WTd=nan, v_WTd=nan, a_WTd=nan)

class Disturbance(PartConfig):
    """Adds a motor that nobody knows of."""
    type: Literal["bad_disturbance"] = "bad_disturbance"
    def build(self, rng): return Motor()

class Motor(PlantPart):
    def modify(self, spec):
        body = spec.worldbody.add_body(name="wheel", mass=1.0, inertia=[1, 1, 1], ipos=[0, 0, 0])
        body.add_joint(name="wheel")
        actuator = spec.add_actuator(name="wheel", target="wheel")
        import mujoco
        actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT

class Prop(PartConfig):
    """Cannot be built."""
    type: Literal["bad_prop"] = "bad_prop"
    def build(self, rng): raise RuntimeError("no wood left")

class Plant(PartConfig):
    type: Literal["bad_plant"] = "bad_plant"
    must: float
    def build(self, scene, period_s, parts, seed): return None

class Scheme(PartConfig):
    """Left its kernels as they were written."""
    type: Literal["bad_scheme"] = "bad_scheme"
    def build(self, period_s, round_trip_s):
        from surgsim.teleop.bilateral.base import BilateralScheme
        nothing = lambda gains, end, memory: 0
        return BilateralScheme(feel=nothing, tell=nothing, follow=nothing)

class Misnamed(PartConfig):
    """A type that is not its name."""
    type: Literal["other"] = "other"

def policy(observation):
    return np.zeros(2)

metric = Metric(
    name="bad_metric", heading="luck", meaning="another number each time", compute=lambda _: random.random()
)
'''
KINDS = {
    "resolvers": "Resolver",
    "torque_laws": "Law",
    "port_estimators": "Estimator",
    "instrument_estimators": "Instrument",
    "tasks": "Task",
    "disturbances": "Disturbance",
    "props": "Prop",
    "plants": "Plant",
    "bilateral": "Scheme",
    "policies": "policy",
    "metrics": "metric",
}


def points(prefix, module):
    """Entry points of one part of every kind."""
    lines = []
    for group, attribute in KINDS.items():
        name = f"{prefix}_{attribute.lower()}"
        lines.append(f"[surgsim.{group}]\n{name} = {module}:{attribute}\n")
    return "\n".join(lines)


def install(folder: Path, name: str, entry_points: str, **modules: str) -> None:
    """A distribution as pip leaves it."""
    info = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(entry_points)
    for module, text in modules.items():
        (folder / f"{module}.py").write_text(text)


@pytest.fixture
def surgsim(tmp_path):
    """Runs a command where the packages of the folder `site` are installed."""

    def call(*words):
        path = os.pathsep.join([str(tmp_path / "site"), *filter(None, sys.path)])
        done = subprocess.run(
            [sys.executable, "-W", "error", "-m", "surgsim", *words],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": path},
            capture_output=True,
            text=True,
            timeout=200,
        )
        done.stderr = re.sub(r"(?m)^compil(ing|ed) .*\n", "", done.stderr)  # said where kernels are new
        return done

    return call


def test_good_parts_of_every_kind_keep_every_promise(surgsim, tmp_path):
    install(tmp_path / "site", "my-lab", points("my", "my_lab"), my_lab=GOOD)
    done = surgsim("test-part", "my_lab", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    rows = json.loads(done.stdout)
    assert {row["kind"] for row in rows} == {
        "resolver",
        "torque law",
        "port estimator",
        "instrument estimator",
        "task",
        "disturbance",
        "prop",
        "plant",
        "bilateral scheme",
        "policy",
        "metric",
    }
    assert all(row["passed"] and row["detail"] == "" for row in rows)
    assert len([row for row in rows if row["part"] == "my_resolver"]) == 10


BROKEN = {
    "bad_resolver": ("answers are finite, inside the bounds", "rad/s beyond the bounds"),
    "bad_law": ("a finite row for every term", "the same problem gives other torques again"),
    "bad_estimator": ("starts where the trocar is seen", "the first estimate is 0.01 m from where"),
    "bad_instrument": ("corrects nothing without a tracker", "a correction of 0.0001 without a tracked"),
    "bad_task": ("commands are finite", "a command is not finite"),
    "bad_disturbance": (
        "leaves the arm as the controller knows it",
        "6 joints: the scene has 7 motors, not 6",
    ),
    "bad_prop": ("is deterministic under a seed", "6 joints: RuntimeError: no wood left"),
    "bad_plant": ("every key has a default", "must"),
    "bad_scheme": ("kernels are compiled", "kernel 'feel' must be compiled"),
    "bad_metric": ("gives a number or none, and the same again", "the same run gives 0."),
    "bad_policy": (
        "actions are finite, of one shape",
        "6 joints: an action has the shape (2,), not (3,) or (6,)",
    ),
}


def test_bad_parts_of_every_kind_are_told_what_they_break(surgsim, tmp_path):
    install(tmp_path / "site", "bad-lab", points("bad", "bad_lab"), bad_lab=BAD)
    done = surgsim("test-part", "bad-lab", "--json")
    assert (done.returncode, done.stderr) == (1, "")
    rows = json.loads(done.stdout)
    broken = {(row["part"], row["check"]): row["detail"] for row in rows if not row["passed"]}
    for part, (promise, reason) in BROKEN.items():
        said = [text for (name, check), text in broken.items() if name == part and check.startswith(promise)]
        assert said, f"{part} keeps '{promise}'"
        assert reason in said[0]


FOR_SEVEN = '''
"""Parts that were written for an arm of seven joints."""
from typing import ClassVar, Literal
import numpy as np
from surgsim.catalog import PartConfig
from surgsim.control.problem import Resolution
from surgsim.control.resolvers.pinv import PinvConfig

class Resolver(PartConfig):
    """Damps what is there, of seven joints."""
    type: Literal["seven"] = "seven"
    def build(self, arm): return self
    def start(self, problem): return None
    def step(self, problem, memory): return Resolution(qdot=np.full(7, 1e-3), residual=0.0), None

class Wasteful(PinvConfig):
    """Needs more than any arm has."""
    type: Literal["wasteful"] = "wasteful"
    needs_redundancy: ClassVar[int] = 4
'''


def test_a_part_for_seven_joints_alone_is_told_so(surgsim, tmp_path):
    points = "[surgsim.resolvers]\nseven = seven_lab:Resolver\nwasteful = seven_lab:Wasteful\n"
    install(tmp_path / "site", "seven-lab", points, seven_lab=FOR_SEVEN)
    done = surgsim("test-part", "seven-lab", "--json")
    assert (done.returncode, done.stderr) == (1, "")
    broken = {
        (row["part"], row["check"]): row["detail"] for row in json.loads(done.stdout) if not row["passed"]
    }
    finite = "answers are finite, inside the bounds, with their residual"
    assert broken["seven", finite] == "6 joints: qdot has the shape (7,), not (6,)"
    redundancy = {part: text for (part, check), text in broken.items() if check.startswith("says how much")}
    assert redundancy == {"wasteful": "needs_redundancy is 4; an arm of eight joints has 3 with a trocar"}


def test_a_metric_of_a_package_is_a_metric_of_every_run(surgsim, tmp_path):
    install(tmp_path / "site", "my-lab", "[surgsim.metrics]\nmy_metric = my_lab:metric\n", my_lab=GOOD)
    short = ("--set", "task.duration_s=2.0", "--set", "task.hold_end_s=0.0")
    names = ("--controllers", "pinv,gradient", "--metric", "my_metric", "--out", "batch", "--record")
    compared = surgsim("compare", "circle_lwr4plus", *short, *names)
    assert compared.returncode == 0, compared.stderr
    assert "by rows" in compared.stdout
    run = next((tmp_path / "batch").rglob("metrics.json"))
    stored = json.loads(run.read_text())
    assert stored["metrics"]["my_metric"] > 2000.0
    assert stored["provenance"]["plugins"]["my_lab"]["version"] == "1.0"
    assert surgsim("inspect", str(run.parent)).returncode == 0
    (tmp_path / "site" / "my_lab-1.0.dist-info" / "entry_points.txt").unlink()
    assert surgsim("inspect", str(run.parent)).returncode == 0  # as it was, without that metric
    assert surgsim("report", "batch").returncode == 0


def test_a_metric_that_cannot_be_used_is_named(surgsim, tmp_path):
    entries = "[surgsim.metrics]\nsparc = my_lab:metric\nother = my_lab:metric\nno = my_lab:nothing\n"
    install(tmp_path / "site", "my-lab", entries, my_lab=GOOD)
    listed = surgsim("list", "metrics")
    assert listed.returncode == 0
    by = "of the package my-lab 1.0"
    said = listed.stderr.splitlines()
    assert f"surgsim: metric 'sparc' {by}: the name is that of a shipped metric; it is not computed" in said
    assert any(line.startswith(f"surgsim: metric 'other' {by} calls itself 'my_metric'") for line in said)
    assert any(line.startswith(f"surgsim: metric 'no' {by} does not load") for line in said)
    assert surgsim("test-part", "my-lab").returncode == 1


POINTS = """
[surgsim.resolver]
one = my_lab:Resolver
[surgsim.resolvers]
absent = nowhere_at_all:Config
pinv = my_lab:Resolver
misnamed = bad_lab:Misnamed
[surgsim.policies]
broken = broken_lab:policy
"""


def test_parts_that_cannot_be_used_are_named_and_nothing_else_stops(surgsim, tmp_path):
    modules = {"my_lab": GOOD, "bad_lab": BAD, "broken_lab": "1 / 0\n"}
    install(tmp_path / "site", "odd-lab", POINTS, **modules)
    odd = "of the package odd-lab 1.0"
    known = ", ".join(sorted(GROUPS))
    hint = "'surgsim.resolver' is not a group of entry points. Known: {}. Did you mean 'surgsim.resolvers'?"
    absent = f"resolver 'absent' {odd} does not load: No module named 'nowhere_at_all'"
    misnamed = f"resolver 'misnamed' {odd} (Misnamed) needs the field type: Literal['misnamed']"
    fine = surgsim("check", "--quiet", "circle_lwr4plus")
    assert fine.returncode == 0
    assert fine.stderr.splitlines() == [
        f"surgsim: 'one' in the group surgsim.resolver {odd} is not used: {hint.format(known)}",
        f"surgsim: {absent}; no scenario can name it",
        f"surgsim: {misnamed}; no scenario can name it",
    ]
    named = surgsim("check", "circle_lwr4plus", "--set", "controller.resolver={type: absent}")
    assert named.returncode == 2
    assert named.stderr.splitlines()[-1].endswith(f"controller.resolver: {absent}")
    proportional = ("--controller", "policy_proportional", "--set", "controller.resolver.name=broken")
    policy = surgsim("check", "circle_lwr4plus", *proportional)
    assert policy.returncode == 2
    assert f"policy 'broken' {odd} does not load: ZeroDivisionError: division by zero" in policy.stderr

    tested = surgsim("test-part", "odd-lab", "--json")
    assert tested.returncode == 1
    said = {row["part"]: row["detail"] for row in json.loads(tested.stdout) if not row["passed"]}
    assert said == {
        "one": hint.format(known),
        "absent": absent,
        "pinv": "the name is that of a shipped resolver, which hides it",
        "misnamed": misnamed,
        "broken": f"policy 'broken' {odd} does not load: ZeroDivisionError: division by zero",
    }


def test_a_name_that_two_packages_give_is_said(surgsim, tmp_path):
    for name in ("a-lab", "b-lab"):
        install(tmp_path / "site", name, "[surgsim.resolvers]\nmy_resolver = my_lab:Resolver\n", my_lab=GOOD)
    text = "'my_resolver' in the group surgsim.resolvers of the package b-lab 1.0 is not used"
    reason = "the name is taken by the part of the package a-lab 1.0"
    assert surgsim("check", "--quiet", "circle_lwr4plus").stderr == f"surgsim: {text}: {reason}\n"
    assert surgsim("test-part", "b-lab").returncode == 1


def test_an_unknown_package_is_refused_with_a_hint(surgsim, tmp_path):
    install(tmp_path / "site", "my-lab", points("my", "my_lab"), my_lab=GOOD)
    done = surgsim("test-part", "my-lap")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("surgsim: 'my-lap' is not a package installed here with an entry point")
    assert "Did you mean 'my-lab'?" in done.stderr


PROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "wheel-lab"
version = "1.0"

[project.entry-points."surgsim.resolvers"]
my_resolver = "my_lab:Resolver"

[tool.hatch.build.targets.wheel]
only-include = ["my_lab.py"]
"""


def test_a_package_installed_from_its_wheel(surgsim, tmp_path):
    source = tmp_path / "source"
    source.mkdir()
    (source / "pyproject.toml").write_text(PROJECT)
    (source / "my_lab.py").write_text(GOOD)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]
    alone = ["--no-deps", "--no-build-isolation", "--no-index"]
    wheels, site = tmp_path / "wheels", tmp_path / "site"
    subprocess.run([*pip, "wheel", *alone, "-w", wheels, source], check=True, timeout=200)
    (wheel,) = wheels.iterdir()
    subprocess.run([*pip, "install", *alone, "--target", site, wheel], check=True, timeout=200)
    done = surgsim("test-part", "wheel-lab")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("wheel-lab: 1 part, 10 checks, none broken\n")
    assert "resolver my_resolver" in done.stdout


def test_a_package_brings_an_instrument_that_a_scenario_names(surgsim, tmp_path):
    """It is listed, keeps its promises, runs, and stands with its package in the provenance."""
    for name, text in {"my_hook": HOOK.read_text(), "bad_hook": "<mujoco><worldbody/></mujoco>"}.items():
        folder = tmp_path / "site" / "lab_tools" / name
        folder.mkdir(parents=True)
        (folder / "__init__.py").write_text("")
        (folder / f"{name}.xml").write_text(text)
    (tmp_path / "site" / "lab_tools" / "__init__.py").write_text("")
    points = "my_hook = lab_tools.my_hook\nbad_hook = lab_tools.bad_hook\nlost = lab_tools.nowhere\n"
    install(tmp_path / "site", "lab-tools", f"[surgsim.instruments]\n{points}")
    listed = json.loads(surgsim("list", "instruments", "--json").stdout)
    said = {item["name"]: item["description"] for item in listed}
    assert said["my_hook"].startswith("Electrocautery hook")
    assert "instrument 'lost' of the package lab-tools 1.0" in said["lost"]
    rows = json.loads(surgsim("test-part", "lab-tools", "--json").stdout)
    assert all(row["passed"] for row in rows if row["part"] == "my_hook")
    assert {row["part"] for row in rows if not row["passed"]} == {"bad_hook", "lost"}
    assert {row["kind"] for row in rows} == {"instrument"}
    refused = surgsim("check", "circle_lwr4plus", "--set", "instrument={name: bad_hook}")
    assert refused.returncode == 2
    assert "instrument 'bad_hook' of the package lab-tools 1.0: " in refused.stderr
    assert refused.stderr.count("\n") == 1
    short = ("--set", "task.duration_s=2.0", "--set", "task.radius_m=0.005")
    words = ("--set", "instrument={name: my_hook}", "--controller", "rcm_inverse_dynamics", "--out", "run")
    done = surgsim("run", "circle_lwr4plus", *short, *words, "--no-record")
    assert done.returncode == 0, done.stderr
    files = [json.loads(file.read_text()) for file in (tmp_path / "run").rglob("*.json")]
    told = next(file["provenance"]["plugins"] for file in files if "provenance" in file)
    assert told["lab_tools"]["version"] == "1.0"
    assert re.fullmatch("[0-9a-f]{64}", told["lab_tools"]["sources_sha256"])
