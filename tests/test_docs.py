"""The documents tell the truth: links, commands, examples, tables of keys, names and versions."""

import json
import os
import re
import shlex
import tomllib
from pathlib import Path
from typing import Literal, get_args, get_origin

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from pydantic_core import PydanticUndefined

from surgsim.catalog import PartConfig
from surgsim.cli.main import build_parser
from surgsim.control.controller import ControllerConfig
from surgsim.control.instrument_estimators import INSTRUMENT_ESTIMATORS
from surgsim.control.port_estimators import PORT_ESTIMATORS
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.torque_laws import TORQUE_LAWS
from surgsim.metrics.catalog import METRICS, compute_metrics
from surgsim.models.adopted.config import CapsuleConfig, FlangeConfig, LimitsConfig
from surgsim.models.config import (
    HolderConfig,
    InstrumentConfig,
    PatientConfig,
    RobotConfig,
    TrocarConfig,
    WallConfig,
)
from surgsim.models.drive import DriveConfig
from surgsim.plant import PLANTS
from surgsim.plant.disturbances import DISTURBANCES
from surgsim.plant.props import PROPS
from surgsim.scenario.arms import ArmConfig, ArmsScenario
from surgsim.scenario.load import load_controller, load_experiment, load_scenario, shipped
from surgsim.scenario.schema import (
    RecordingConfig,
    SafetyConfig,
    Scenario,
    SimulationConfig,
    StartConfig,
    StopConfig,
)
from surgsim.scenario.thresholds import Threshold, ThresholdsConfig
from surgsim.scenario.yaml_text import parse_yaml
from surgsim.simulate.loop import prepared, simulate
from surgsim.tasks import TASKS
from surgsim.tasks.base import PathTaskConfig
from surgsim.teleop.bilateral import BILATERAL
from surgsim.trace.trace import base_blocks

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted(page for pattern in ("*.md", "docs/**/*.md", "benchmarks/*.md") for page in ROOT.glob(pattern))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def text_of(name):
    return (ROOT / name).read_text()


def blocks(language):
    """(page, code) of every fenced block of a language."""
    found = []
    for page in PAGES:
        pattern = rf"^```{language}\n(.*?)^```$"
        for number, match in enumerate(re.finditer(pattern, page.read_text(), re.M | re.S)):
            name = f"{page.relative_to(ROOT)}-{number}"
            found.append(pytest.param(match[1], id=name))
    return found


def anchors(page):
    """Names by which a page's headings can be linked to."""
    prose = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S)
    headings = re.findall(r"^#+ +(.+)$", prose, re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_pictures_lead_somewhere(page):
    prose = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S)
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", prose):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists() or (anchor and anchor not in anchors(file)):
            broken.append(target)
    assert broken == []


def saved_files():
    """Name and content of every model file that a page tells a reader to save: scenarios name them."""
    pages = "".join(page.read_text() for page in PAGES)
    return re.findall(r"Save this as `([\w.]+)`[^\n]*\n\n```xml\n(.*?)^```$", pages, re.M | re.S)


@pytest.mark.parametrize("text", blocks("yaml"))
def test_yaml_examples_are_valid(text, tmp_path):
    tree = parse_yaml(text, "example").tree
    path = tmp_path / "example.yaml"
    path.write_text(text)
    for file, content in saved_files():
        (tmp_path / file).write_text(content)
    if "robot" in tree or "arms" in tree:
        prepared(load_experiment(str(path)))
    elif "resolver" in tree:
        load_controller(str(path))
    else:
        pytest.fail("neither a scenario nor a controller; fence fragments as text")


@pytest.mark.parametrize("code", blocks("python"))
def test_python_examples_run(code, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("surgsim.control.policies.registry._registered", {})  # a page's policy is its own
    exec(compile(code, "example", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out


@pytest.mark.parametrize("code", blocks("bash"))
def test_commands_exist(code):
    targets = re.search(r"^\.PHONY: (.+)$", text_of("Makefile"), re.M)[1].split()
    for line in code.splitlines():
        words = shlex.split(line, comments=True)
        if words[:1] == ["surgsim"]:
            options = build_parser().parse_args(words[1:])
            name = getattr(options, "scenario", None)
            assert name is None or name in shipped() or name.endswith(".yaml")
        elif words[:1] == ["make"]:
            assert set(words[1:]) <= set(targets)


def inner(annotation):
    """Config classes named anywhere inside a type."""
    if isinstance(annotation, type) and issubclass(annotation, PartConfig):
        return [annotation]
    return [found for part in get_args(annotation) for found in inner(part)]


def sections():
    """(heading of docs/scenario_format.md, config class), one for every class of the schema."""
    found = {
        "scenario": Scenario,
        "several arms": ArmsScenario,
        "several arms: arm": ArmConfig,
        "patient": PatientConfig,
        "robot": RobotConfig,
        "robot: drive": DriveConfig,
        "robot: flange": FlangeConfig,
        "robot: limits": LimitsConfig,
        "robot: capsule": CapsuleConfig,
        "instrument": InstrumentConfig,
        "instrument: holder": HolderConfig,
        "trocar": TrocarConfig,
        "trocar.wall": WallConfig,
        "start": StartConfig,
        "simulation": SimulationConfig,
        "safety": SafetyConfig,
        "safety: stop": StopConfig,
        "thresholds": ThresholdsConfig,
        "thresholds: threshold": Threshold,
        "recording": RecordingConfig,
        "controller": ControllerConfig,
    }
    estimators = (PORT_ESTIMATORS, INSTRUMENT_ESTIMATORS)
    for catalog in (TASKS, PLANTS, DISTURBANCES, PROPS, RESOLVERS, TORQUE_LAWS, BILATERAL, *estimators):
        for name in catalog.names():
            config = catalog.config(name)
            if config.__module__.startswith("surgsim."):
                found[f"{catalog.kind}: {name}"] = config
                for key, field in config.model_fields.items():
                    parts = [part for part in inner(field.annotation) if "type" not in part.model_fields]
                    for part in parts:  # one with a type is in a catalog and has its own section
                        found[f"{catalog.kind}: {name}, {key}"] = part
    return [pytest.param(heading, config, id=heading) for heading, config in found.items()]


def documented(heading):
    """Cells (type, default, meaning) by key in a section's table of docs/scenario_format.md."""
    page = text_of("docs/scenario_format.md")
    match = re.search(rf"^##+ {re.escape(heading)}\n(.*?)(?=^##|\Z)", page, re.M | re.S)
    assert match, f"docs/scenario_format.md has no section '{heading}'"
    rows = re.findall(r"^\| `(\w+)` \| (.+?) \| (.+?) \| (.+?) \|$", match[1], re.M)
    return {key: cells for key, *cells in rows}


def keys_of(config):
    """The keys that a section must explain; `type` with one value is in its heading."""
    fields = config.model_fields.items()
    common = PathTaskConfig.model_fields if issubclass(config, PathTaskConfig) else {}
    return {
        key: field
        for key, field in fields
        if key not in common and not (key == "type" and get_origin(field.annotation) is Literal)
    }


@pytest.mark.parametrize(
    ("heading", "config"), [*sections(), pytest.param("task: every path", None, id="task: every path")]
)
def test_every_key_of_a_scenario_is_documented_with_its_default(heading, config):
    rows = documented(heading)
    wanted = PathTaskConfig.model_fields if config is None else keys_of(config)
    assert sorted(rows) == sorted(wanted)
    for key, field in wanted.items():
        cell = rows[key][1]
        if field.default is PydanticUndefined:
            assert cell == "required", key
        elif not isinstance(field.default, PartConfig):
            default = json.loads(json.dumps(field.default))  # tuples, nested too, as lists
            assert parse_yaml(f"x: {cell.strip('`')}", key).tree["x"] == default, key


def test_every_metric_and_column_is_in_the_contracts():
    page = text_of("docs/architecture.md")
    assert [name for name in METRICS if f"`{name}`" not in page] == []
    assert [block.name for block in base_blocks(7) if not re.search(rf"`{block.name}[_{{`]", page)] == []


def requirements():
    extras = PROJECT["project"]["optional-dependencies"].values()
    return [Requirement(line) for lines in (PROJECT["project"]["dependencies"], *extras) for line in lines]


def test_every_dependency_has_a_reason_and_nothing_else_is_listed():
    rows = re.findall(r"^\| `([\w.-]+)` \|", text_of("docs/dependencies.md"), re.M)
    assert sorted(rows) == sorted({requirement.name for requirement in requirements()})


def test_constraints_pin_every_dependency_at_an_allowed_version():
    lines = [line for line in text_of("constraints.txt").splitlines() if not line.startswith("#")]
    assert all(re.fullmatch(r"[\w.-]+==[\w.]+", line) for line in lines)
    pins = {canonicalize_name(line.split("==")[0]): line.split("==")[1] for line in lines}
    for requirement in requirements():
        assert requirement.specifier.contains(pins[canonicalize_name(requirement.name)]), requirement


@pytest.mark.skipif(os.name != "posix", reason="the file mode means nothing there")
def test_ci_runs_the_commands_of_the_readme():
    script = ROOT / ".ci" / "run"
    assert script.stat().st_mode & 0o111
    for target in ("test", "check"):
        assert re.search(rf"^make .*\b{target}$", script.read_text(), re.M)
        assert f"make {target}" in text_of("README.md")


def test_ci_installs_every_extra_and_leaves_no_test_out():
    makefile, script = text_of("Makefile"), text_of(".ci/run")
    (extras,) = re.findall(r"^EXTRAS := ([\w,]+)$", makefile, re.M)
    assert sorted(extras.split(",")) == sorted(PROJECT["project"]["optional-dependencies"])
    assert "install-all\n" in script
    assert "PYTEST_ARGS=--no-skips test\n" in script


PATHS = ("circle", "sinusoid", "spiral")


@pytest.mark.slow
def test_the_nominal_results_are_those_of_this_version():
    columns = ("tip_error_rms_mm", "tip_error_max_mm", "rcm_error_rms_mm", "rcm_error_max_mm")
    page = text_of("docs/results.md")
    fresh, wrong = [], []
    listed = set(re.findall(r"^\| `(\w+)` \| [\d.]", page, re.M)) & set(shipped())
    assert {name for name in shipped() if name.split("_")[0] in PATHS} <= listed
    for name in sorted(listed):
        metrics = compute_metrics(simulate(load_scenario(name)))
        values = [metrics[column] for column in columns]
        fresh.append(f"| `{name}` | " + " | ".join(f"{value:.3g}" for value in values) + " |")
        row = re.search(rf"^\| `{name}` \| (.+) \|$", page, re.M)
        if not row or [float(cell) for cell in row[1].split("|")] != pytest.approx(values, rel=0.02):
            wrong.append(name)
    assert not wrong, "docs/results.md should say\n" + "\n".join(fresh)


def test_the_readme_stays_short():
    assert len(text_of("README.md").splitlines()) < 150
