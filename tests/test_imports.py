"""Imports go one way, and heavy or foreign packages stay where they belong."""

import ast
from pathlib import Path

import pytest

import surgsim

# Lowest first. A module belongs to its longest matching prefix and never imports from a higher layer.
LAYERS = (
    "surgsim",
    "surgsim.array",
    "surgsim.errors",
    "surgsim.packages",
    "surgsim.resources",
    "surgsim.compiling",
    "surgsim.compiled",
    "surgsim.spatial",
    "surgsim.tick",
    "surgsim.columns",
    "surgsim.display",
    "surgsim.plugins",
    "surgsim.catalog",
    "surgsim.models",
    "surgsim.teleop",
    "surgsim.tasks",
    "surgsim.plant.state",
    "surgsim.plant.truth",
    "surgsim.plant.records",
    "surgsim.plant.shaft",
    "surgsim.plant.explicit",
    "surgsim.plant.bore",
    "surgsim.plant.part",
    "surgsim.plant.disturbances",
    "surgsim.plant.props",
    "surgsim.control",
    "surgsim.plant",
    "surgsim.scenario",
    "surgsim.trace",
    "surgsim.simulate",
    "surgsim.metrics",
    "surgsim.verdict",
    "surgsim.recording",
    "surgsim.runs",
    "surgsim.live",
    "surgsim.env",
    "surgsim.compare",
    "surgsim.tuning",
    "surgsim.report",
    "surgsim.adopt",
    "surgsim.studies",
    "surgsim.export",
    "surgsim.protocol",
    "surgsim.contract",
    "surgsim.bench",
    "surgsim.cli",
    "surgsim.api",
    "surgsim.__main__",
)
# Who may import what, where it is not everyone.
ONLY = {
    "rerun": ("surgsim.recording",),
    "pandas": ("surgsim.api", "surgsim.compare.columns", "surgsim.trace"),
    "pyarrow": (
        "surgsim.api",
        "surgsim.compare.columns",
        "surgsim.compare.table",
        "surgsim.export",
        "surgsim.recording",
    ),
    "av": ("surgsim.export.moving",),
    "mujoco": (
        "surgsim.models",
        "surgsim.teleop",
        "surgsim.tick.mujoco_calls",
        "surgsim.bench",
        "surgsim.plant",
        "surgsim.recording",
        "surgsim.simulate",
        "surgsim.live",
        "surgsim.control.mink_tasks",
        "surgsim.control.resolvers.mink",
    ),
    "glfw": ("surgsim.live.window",),
    "mink": ("surgsim.bench.libraries.with_mink", "surgsim.control"),
    "placo": ("surgsim.bench.libraries.with_placo",),
    "pink": ("surgsim.bench.libraries.with_pink",),
    "pinocchio": ("surgsim.bench.libraries.with_pink",),
    "dqrobotics": ("surgsim.bench.libraries.with_dqrobotics",),
    "cmaes": ("surgsim.tuning.search",),
    "ruamel": ("surgsim.models.drive", "surgsim.scenario"),
    "argparse": ("surgsim.cli",),
    "rich": ("surgsim.cli",),
    "matplotlib": (
        "surgsim.adopt",
        "surgsim.api",
        "surgsim.export",
        "surgsim.protocol.passport",
        "surgsim.studies",
    ),
    "dm_control": ("surgsim.env",),
    "dm_env": ("surgsim.env",),
    "gymnasium": ("surgsim.env.gymnasium",),
}
ROOT = Path(surgsim.__file__).parent


def _inside(module, prefix):
    return module == prefix or module.startswith(prefix + ".")


def _name(path):
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {_name(path): path for path in sorted(ROOT.rglob("*.py")) if "_data" not in path.parts}


def _imports(module, tree):
    """Every module that `tree` imports, also inside functions and for type checking."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            assert node.level == 0, f"{module}: relative import of {base}"
            for alias in node.names:
                whole = f"{base}.{alias.name}"
                yield whole if whole in MODULES else base


def _layer(module):
    fitting = [i for i, prefix in enumerate(LAYERS) if module == prefix or (i and _inside(module, prefix))]
    assert fitting, f"{module} has no layer"
    return max(fitting, key=lambda i: len(LAYERS[i]))


def _upward(module, imports):
    ours = [name for name in imports if _inside(name, "surgsim")]
    return [name for name in ours if _layer(name) > _layer(module)]


@pytest.fixture(scope="module")
def imports():
    return {name: list(_imports(name, ast.parse(path.read_text()))) for name, path in MODULES.items()}


def test_no_module_imports_from_a_higher_layer(imports):
    wrong = {module: up for module, names in imports.items() if (up := _upward(module, names))}
    assert wrong.pop("surgsim") != []  # names for type checkers alone, see below
    assert wrong == {}


def test_the_package_itself_imports_nothing_of_ours():
    tree = ast.parse(MODULES["surgsim"].read_text())
    at_once = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    assert not [name for name in _imports("surgsim", ast.Module(at_once, [])) if _inside(name, "surgsim")]


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("surgsim.control.rcm", "def f():\n    from surgsim.plant.dynamic import DynamicPlant"),
        ("surgsim.models.arm", "if TYPE_CHECKING:\n    from surgsim.tasks.base import Task"),
        ("surgsim.metrics.metric", "import surgsim.recording.write"),
        ("surgsim.errors", "from surgsim import spatial"),
    ],
)
def test_the_check_above_catches_what_it_should(module, line):
    assert _upward(module, _imports(module, ast.parse(line)))


def test_controllers_know_of_the_plant_only_its_state(imports):
    seen = {name for module, names in imports.items() if _inside(module, "surgsim.control") for name in names}
    assert {name for name in seen if _inside(name, "surgsim.plant")} == {"surgsim.plant.state"}


def test_metrics_see_the_trace_and_the_nominal_model_but_never_the_plant(imports):
    seen = {name for module, names in imports.items() if _inside(module, "surgsim.metrics") for name in names}
    forbidden = ("surgsim.plant", "surgsim.simulate", "surgsim.tasks", "surgsim.scenario")
    assert {name for name in seen if any(_inside(name, layer) for layer in forbidden)} == set()


@pytest.mark.parametrize("package", ONLY)
def test_foreign_packages_stay_where_they_belong(imports, package):
    users = {module for module, names in imports.items() if any(_inside(name, package) for name in names)}
    assert {m for m in users if not any(_inside(m, allowed) for allowed in ONLY[package])} == set()
