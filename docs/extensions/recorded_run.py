"""A recorded run in rerun's own viewer, as files of the site: the gallery opens it where the viewer starts.

The viewer for browsers is part of the installed rerun-sdk, so that it reads what that release writes. It is
taken from there once a build, and is no file of the repository (43 MB). It asks no other host: what it would
load from one is taken out, and a policy in its page forbids the rest.
"""

import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.error import URLError
from urllib.request import urlopen

from sphinx.application import Sphinx

import surgsim

MARK = "<!-- recording in the viewer -->"
"""Where a page has the recording; in the repository nothing is seen of it."""

FOLDER = "docs/recorded_run"
_SCENARIO, _TASK = "circle_lwr4plus", {"duration_s": 6.0}
_VIEWER = (sys.executable, "-P", "-c", "import sys; from rerun_cli.__main__ import main; sys.exit(main())")
_FILES = ("re_viewer.js", "re_viewer_bg.wasm", "favicon.ico")
_PATIENCE_S = 60.0
_POLICY = "default-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; connect-src 'self' blob: data:"
_OF_QUERY = 'url: query.getAll("url")'
_OF_THIS_RUN = 'url: [new URL("recording.rrd", window.location).href]'

_HTML = """
```{raw} html
<p class="recorded-run">
<a href="recorded_run/index.html">Open this recording in the viewer</a> (43 MB, once)
</p>
<script>
document.querySelector(".recorded-run a").addEventListener("click", (event) => {
  const link = event.currentTarget;
  if (link.dataset.opened) return;
  event.preventDefault();
  const place = document.querySelector(".recorded-run");
  if (window.location.protocol === "file:") {
    place.textContent = "No browser starts it from a file: type python -m http.server in the site's folder.";
    return;
  }
  const frame = document.createElement("iframe");
  frame.src = link.href;
  frame.title = "The recording of a circle in the viewer";
  frame.allowFullscreen = true;
  place.prepend(frame);
  link.textContent = "Open it in a page of its own";
  link.dataset.opened = "yes";
});
</script>
```
"""


def place(app: Sphinx, docname: str, content: list[str]) -> None:
    """Put the link where a page has the mark."""
    content[0] = content[0].replace(MARK, _HTML)


def write(app: Sphinx, exception: Exception | None) -> None:
    """Write the run's recording and the viewer into the site."""
    if exception is None and app.builder.format == "html":
        folder = Path(app.outdir) / FOLDER
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        with tempfile.TemporaryDirectory() as scratch:
            run = surgsim.run(_SCENARIO, task=_TASK, out=Path(scratch) / "run")
            shutil.copyfile(Path(str(run.folder)) / "recording.rrd", folder / "recording.rrd")
        with _served() as address:
            for name in _FILES:
                (folder / name).write_bytes(_fetched(f"{address}/{name}"))
            page = _fetched(address).decode("utf-8")
        (folder / "index.html").write_text(alone(page), encoding="utf-8")


def alone(page: str) -> str:
    """The viewer's page with this recording, without what it loads from other hosts.

    Raises:
        ValueError: If the page is not what it was: another release of rerun.
    """
    if page.count(_OF_QUERY) != 1 or "<head>" not in page:
        raise ValueError(
            "the viewer's page is another one: docs/extensions/recorded_run.py has to be changed"
        )
    page = re.sub(r"<link\b[^>]*>", "", page).replace(_OF_QUERY, _OF_THIS_RUN)
    policy = f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}" />'
    return page.replace("<head>", f'<head>\n    {policy}\n    <link rel="icon" href="favicon.ico" />')


@contextmanager
def _served() -> Iterator[str]:
    """Address at which rerun serves its viewer, to this machine alone, meanwhile."""
    page, data = _free_ports(2)
    ports = ("--web-viewer-port", str(page), "--port", str(data), "--bind", "127.0.0.1")
    silent = subprocess.DEVNULL
    with tempfile.TemporaryDirectory() as home:  # it would keep settings in that of the user
        at_home = os.environ | {"HOME": home, "XDG_CONFIG_HOME": home, "XDG_DATA_HOME": home}
        server = subprocess.Popen(
            [*_VIEWER, "--serve-web", *ports], env=at_home, stdout=silent, stderr=silent
        )
        try:
            yield f"http://127.0.0.1:{page}"
        finally:
            server.terminate()
            server.wait()


def _fetched(address: str) -> bytes:
    """What is at an address, once it is served."""
    until = time.monotonic() + _PATIENCE_S
    while True:
        try:
            with urlopen(address, timeout=_PATIENCE_S) as answer:
                return bytes(answer.read())
        except URLError:
            if time.monotonic() > until:
                raise
            time.sleep(0.2)


def _free_ports(count: int) -> list[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect to the build."""
    app.connect("source-read", place)
    app.connect("build-finished", write)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
