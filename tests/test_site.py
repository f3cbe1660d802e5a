"""The documentation site builds without a warning, its links lead somewhere, and it asks no other host."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).resolve().parents[1]
LOADS = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src"}


class Page(HTMLParser):
    """What a page has, links to and loads."""

    def __init__(self, text):
        super().__init__()
        self.names, self.links, self.loads = set(), [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.names |= {found[key] for key in ("id", "name") if found.get(key)}
        if tag == "a" and found.get("href"):
            self.links.append(found["href"])
        if found.get(LOADS.get(tag, "")):
            self.loads.append(found[LOADS[tag]])


def outside(target):
    return re.match(r"(https?:)?//", target) is not None


def broken(path, page, pages):
    """What a page links to or loads that is not there; other hosts are not asked."""
    found = []
    for target in [*page.links, *page.loads]:
        if re.match(r"[a-z]+:", target):
            continue
        address, _, name = target.partition("#")
        file = (path.parent / unquote(address.partition("?")[0])).resolve() if address else path
        if not (file in pages or file.is_file()) or (
            name and file in pages and unquote(name) not in pages[file].names
        ):
            found.append(target)
    return found


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built site; the notebooks are shown and not run: `test_tutorial.py` does that."""
    out = tmp_path_factory.mktemp("site")
    words = ["-W", "--keep-going", "-q", "-D", "nb_execution_mode=off", "-c", "docs", ".", str(out)]
    done = subprocess.run([sys.executable, "-m", "sphinx", *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture(scope="module")
def pages(site):
    found = {path: Page(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    return {path: page for path, page in found.items() if "_static" not in path.parts}


@pytest.mark.needs("sphinx")
def test_every_document_is_a_page(site):
    for path in ROOT.glob("docs/**/*.md"):
        assert (site / path.relative_to(ROOT).with_suffix(".html")).is_file()


@pytest.mark.needs("sphinx")
def test_links_lead_somewhere(site, pages):
    # Links of a leaderboard's page to its runs need the folder of the batch.
    mine = {path: page for path, page in pages.items() if path.name != "report.html"}
    assert {path.name: found for path, page in mine.items() if (found := broken(path, page, pages))} == {}
    assert sum(len(page.links) for page in mine.values()) > 1000


def test_a_broken_link_is_found(tmp_path):
    page = Page(
        '<a href="there.html"></a><a href="#name"></a><a id="here" href="#here"></a><img src="no.png">'
    )
    assert broken(tmp_path / "page.html", page, {tmp_path / "page.html": page}) == [
        "there.html",
        "#name",
        "no.png",
    ]
    assert outside("https://cdn/x.js")
    assert outside("//cdn/x.js")
    assert not outside("../_static/x.js")


@pytest.mark.needs("sphinx")
def test_nothing_is_loaded_from_another_host(site, pages):
    assert [(path, target) for path, page in pages.items() for target in page.loads if outside(target)] == []
    for path in site.rglob("*.css"):
        imported = re.findall(r"@import[^;]+|url\([^)]+\)", path.read_text(encoding="utf-8"))
        assert [text for text in imported if "//" in text and "data:" not in text] == []


@pytest.mark.needs("sphinx")
def test_a_page_is_read_without_scripts(site):
    text = (site / "docs" / "teleoperation.html").read_text(encoding="utf-8")
    assert "<math" in text
    assert "MathJax" not in text
    assert "rcm_error_rms_mm" in (site / "docs" / "reference" / "metrics.html").read_text(encoding="utf-8")
    assert "--controllers" in (site / "docs" / "reference" / "commands.html").read_text(encoding="utf-8")
