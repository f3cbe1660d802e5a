"""Links from pages to files of the repository that are no pages.

A folder leads to its README, source text gets a page that shows it, and any other file is copied, such as the
pages of leaderboards. Each has the address that it has in the repository, with `.html` behind source text.
"""

import posixpath
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import get_lexer_for_filename
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.transforms import SphinxTransform

_SHOWN = (".c", ".h", ".py", ".xml", ".yaml")
_LINK = re.compile(r"\]\((?![a-z]+:)([^)#\s]+)\)")


def links(app: Sphinx, docname: str, content: list[str]) -> None:
    """Links to folders lead to their READMEs; modules are said to be files, since some scripts are pages."""
    here = Path(app.env.doc2path(docname)).parent

    def led(match: re.Match[str]) -> str:
        target = match[1].rstrip("/")
        if (here / target / "README.md").is_file():
            return f"]({target}/README.md)"
        return f"](path:{target})" if target.endswith(".py") and "tutorial/" not in target else match[0]

    if not docname.startswith("docs/tutorial/"):
        content[0] = _LINK.sub(led, content[0])


def branches(app: Sphinx, docname: str, content: list[str]) -> None:
    """Pages that stand below another in the menu; the page itself says nothing of that."""
    below = app.config.pages_below.get(docname)
    if below:
        content[0] += f"\n\n```{{toctree}}\n:hidden:\n:glob:\n\n{below}\n```\n"


class Files(SphinxTransform):
    """What Sphinx takes for a download becomes a link to the file's page."""

    default_priority = 400

    def apply(self, **_: Any) -> None:
        """Change the links of one page."""
        docname = self.env.docname
        for node in list(self.document.findall(addnodes.download_reference)):
            file = posixpath.normpath(
                posixpath.join(posixpath.dirname(docname), node["reftarget"])
                if not node["reftarget"].startswith("/")
                else node["reftarget"][1:]
            )
            _linked(self.env).setdefault(docname, set()).add(file)
            uri = posixpath.relpath(_address(file), posixpath.dirname(docname) or ".")
            node.replace_self(nodes.reference("", "", *node.children, internal=True, refuri=uri))


def _linked(env: BuildEnvironment) -> dict[str, set[str]]:
    """The files that each page links to."""
    if not hasattr(env, "repository_files"):
        env.repository_files = {}
    found: dict[str, set[str]] = env.repository_files
    return found


def _address(file: str) -> str:
    return f"{file}.html" if file.endswith(_SHOWN) else file


def forget(app: Sphinx, env: BuildEnvironment, docname: str) -> None:
    """A page is read again."""
    _linked(env).pop(docname, None)


def pages(app: Sphinx) -> Iterator[tuple[str, dict[str, Any], str]]:
    """A page for each file of source text; copies of the others."""
    for file in sorted(set().union(*_linked(app.env).values())):
        path = Path(app.srcdir) / file
        if file.endswith(_SHOWN):
            lexer = get_lexer_for_filename(file)
            code = highlight(path.read_text(encoding="utf-8"), lexer, HtmlFormatter(cssclass="highlight"))
            yield file, {"title": file, "body": f"<h1>{file}</h1>\n{code}"}, "page.html"
        else:
            to = Path(app.outdir) / file
            to.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, to)


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect to the build."""
    app.add_config_value("pages_below", {}, "env")
    app.connect("source-read", links)
    app.connect("source-read", branches)
    app.connect("env-purge-doc", forget)
    app.connect("html-collect-pages", pages)
    app.add_transform(Files)
    return {"version": "1", "parallel_read_safe": False, "parallel_write_safe": True}
