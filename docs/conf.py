"""How the documentation site is built: `make docs`.

The source folder is the whole repository, so that links between pages lead where they lead in the repository.
The pages are those that `include_patterns` names.
"""

import importlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "docs" / "extensions"), str(ROOT)]
surgsim = importlib.import_module("surgsim")
# `surgsim.compare` is a folder that can be called; its page shows the function that a call reaches.
surgsim.compare = importlib.import_module("surgsim.api.comparing").compare

project = "surgsim"
author = "the surgsim authors"
version = release = surgsim.__version__
html_title = f"surgsim {version}"

root_doc = "docs/index"
include_patterns = [
    "docs/*.md",
    "docs/concepts/*.md",
    "docs/controllers/*.md",
    "docs/reference/*.md",
    "docs/tutorial/*.py",
    "results/*/README.md",
    "examples/README.md",
    "examples/container/README.md",
    "examples/external/*/README.md",
    "benchmarks/README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
]
exclude_patterns = [
    ".*",
    "assets",
    "build",
    "dist",
    "docs/extensions",
    "docs/images",
    "runs",
    "scenarios",
    "surgsim",
    "tests",
]

pages_below = {
    "docs/controllers/README": "[a-z]*",
    "docs/external_controllers": "../examples/external/*/README",
    "docs/submission": "../examples/container/README",
}

lazy_pages = ["docs/gallery"]

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "mathml",
    "repository_files",
    "from_code",
    "recorded_run",
    "lazy_pictures",
]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
myst_links_external_new_tab = False
html_math_renderer = "mathml"

# Notebooks are scripts in jupytext's percent format, run anew at every build: an output is never an old one.
nb_custom_formats = {".py": "percent_scripts.read"}
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_execution_show_tb = True

napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_member_order = "bysource"
default_role = "code"  # docstrings put names between single backticks
add_module_names = False
python_use_unqualified_type_names = True

html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_extra_path = ["front"]
html_copy_source = False
html_show_sphinx = False
pygments_style = "a11y-high-contrast-light"
pygments_dark_style = "a11y-high-contrast-dark"
