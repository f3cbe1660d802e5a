"""The documentation site builds without a warning, its links lead somewhere, and it asks no other host."""

import re
import shutil
import subprocess
import sys
import threading
from functools import partial
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote

import left_out
import pytest
from playwright import sync_api as playwright

import surgsim

ROOT = Path(__file__).resolve().parents[1]
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
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


class Quiet(SimpleHTTPRequestHandler):
    """Serves files and says nothing."""

    def log_message(self, *_):
        pass


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


@pytest.mark.needs("sphinx")
def test_the_gallery_has_all_scenarios_and_its_pictures_are_loaded_when_they_are_seen(site):
    text = (site / "docs" / "gallery.html").read_text(encoding="utf-8")
    names, plain = surgsim.available("scenarios"), re.sub(r"<[^>]*>", "", text)
    assert [name for name in names if f"surgsim run {name}" not in plain] == []
    pictures = re.findall(r"<img [^>]*_images[^>]*>", text)
    assert len(pictures) > len(names)
    assert [picture for picture in pictures if 'loading="lazy"' not in picture] == []


@pytest.mark.needs("sphinx")
def test_a_recorded_run_is_there_with_the_viewer_that_asks_no_other_host(site, pages):
    folder = site / "docs" / "recorded_run"
    assert folder / "index.html" in pages
    assert 'href="recorded_run/index.html"' in (site / "docs" / "gallery.html").read_text(encoding="utf-8")
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert "connect-src 'self' blob: data:" in page
    assert 'new URL("recording.rrd"' in page
    assert (folder / "re_viewer_bg.wasm").read_bytes()[:4] == b"\0asm"
    assert surgsim.read(folder / "recording.rrd").outcome == "completed"


@pytest.mark.needs("sphinx")
@pytest.mark.needs("chromium")
def test_the_gallery_opens_the_recording_and_no_other_host_is_asked(site):
    handler = partial(Quiet, directory=str(site))
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    host = f"127.0.0.1:{server.server_address[1]}"
    threading.Thread(target=server.serve_forever, daemon=True).start()
    asked = set()
    try:
        with playwright.sync_playwright() as runner:
            chromium = next(filter(None, map(shutil.which, left_out.BROWSERS)))
            browser = runner.chromium.launch(executable_path=chromium, args=ARGUMENTS)
            page = browser.new_page()
            page.on("request", lambda request: asked.add(request.url))
            page.goto(f"http://{host}/docs/gallery.html")
            with page.expect_request(
                lambda request: request.url.endswith("/re_viewer_bg.wasm"), timeout=100_000
            ):
                page.click(".recorded-run a")
            browser.close()
    finally:
        server.shutdown()
        server.server_close()
    assert {address.split("/")[2] for address in asked if address.startswith("http")} == {host}
