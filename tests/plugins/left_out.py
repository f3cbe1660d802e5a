"""Tests that need a part of the machine: run where it is; elsewhere left out, counted and named.

A test says what it needs, `@pytest.mark.needs("chromium")`. Without that part it is skipped, and one line at
the end says how many tests were left out and what brings them in. CI gives `--no-skips`: every skip is then a
failure, but for those of `ALLOWED`.
"""

import ctypes.util
import importlib.util
import shutil
import subprocess
from collections import Counter
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
ALLOWED: dict[str, str] = {}
"""Start of a test's id: why no installation lets it run here. CI leaves nothing out."""


@dataclass(frozen=True)
class Part:
    """What some tests need beside the `dev` extra.

    Attributes:
        label: What such tests are called.
        found: Whether it is here.
        without: What is missing, or how to get it.
    """

    label: str
    found: Callable[[], bool]
    without: str

    @property
    def reason(self) -> str:
        return f"{self.label}: {self.without}"


def _may_mount() -> bool:
    command = ["unshare", "-rm", "mount", "-t", "tmpfs", "tmpfs", "/tmp"]
    return shutil.which("unshare") is not None and not subprocess.run(command, capture_output=True).returncode


def _may_be_alone() -> bool:
    command = ["unshare", "--map-root-user", "--net", "true"]
    return shutil.which("unshare") is not None and not subprocess.run(command, capture_output=True).returncode


def _draws() -> bool:
    return any(ctypes.util.find_library(name) for name in ("EGL", "OSMesa"))


PARTS = {
    "chromium": Part("browser", lambda: any(map(shutil.which, BROWSERS)), "no Chromium on the PATH"),
    "ray": Part("Ray", lambda: importlib.util.find_spec("ray") is not None, "pip install 'surgsim[ray]'"),
    "video": Part(
        "video", lambda: importlib.util.find_spec("av") is not None, "pip install 'surgsim[video]'"
    ),
    "sphinx": Part(
        "site", lambda: importlib.util.find_spec("myst_nb") is not None, "pip install 'surgsim[docs]'"
    ),
    "opengl": Part("drawing", _draws, "neither EGL nor OSMesa"),
    "display": Part("window", lambda: shutil.which("Xvfb") is not None, "no Xvfb on the PATH"),
    "compiler": Part("C", lambda: shutil.which("cc") is not None, "no C compiler on the PATH"),
    "namespace": Part("no-network", _may_be_alone, "this system lets us make no network namespace"),
    "mount": Part("full-disk", _may_mount, "this system lets us mount no small disk"),
}


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--no-skips", action="store_true", help="a test that is skipped is a failure")


class LeftOut:
    """Counts what is left out, in workers of xdist too."""

    def __init__(self) -> None:
        self.slow = 0

    def pytest_deselected(self, items: list[pytest.Item]) -> None:
        self.slow += sum(item.get_closest_marker("slow") is not None for item in items)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        output = getattr(session.config, "workeroutput", None)
        if output is not None:
            output["slow"] = self.slow

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        self.slow = max(self.slow, getattr(node, "workeroutput", {}).get("slow", 0))

    def line(self, reasons: list[str]) -> str:
        """What was left out and why, on one line; empty if nothing was."""
        counts = Counter(reasons)
        known = [part for part in PARTS.values() if part.reason in counts]
        words = [_counted(counts.pop(part.reason), part.label, part.without) for part in known]
        words += [_counted(count, "", reason) for reason, count in sorted(counts.items())]
        if self.slow:
            words.append(_counted(self.slow, "slow", "make test-all"))
        return f"left out: {', '.join(words)}" if words else ""


def _counted(count: int, label: str, reason: str) -> str:
    return f"{count} {label}{' ' if label else ''}{'test' if count == 1 else 'tests'} ({reason})"


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "needs(part, ...): left out where the machine lacks a part")
    config.pluginmanager.register(LeftOut(), "surgsim-left-out")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    here: dict[str, bool] = {}
    for item in items:
        for name in [name for marker in item.iter_markers("needs") for name in marker.args]:
            if name not in PARTS:
                raise pytest.UsageError(f"{item.nodeid}: needs '{name}', which is none of {', '.join(PARTS)}")
            if not here.setdefault(name, PARTS[name].found()):
                item.add_marker(pytest.mark.skip(reason=PARTS[name].reason))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, Any]:
    report = yield
    return _judged(report, item.config)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[None, Any, Any]:
    report = yield
    return _judged(report, collector.config)


def _judged(report: Any, config: pytest.Config) -> Any:
    """The report; a skip is a failure where none is allowed."""
    skipped = report.skipped and not hasattr(report, "wasxfail")
    if skipped and config.getoption("--no-skips") and not report.nodeid.startswith(tuple(ALLOWED)):
        report.longrepr = f"{report.nodeid} is left out, and --no-skips allows none ({_reason(report)})"
        report.outcome = "failed"
    return report


def _reason(report: Any) -> str:
    """Why a test or module was skipped."""
    told = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    return str(told).removeprefix("Skipped: ")


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    plugin: Any = config.pluginmanager.get_plugin("surgsim-left-out")
    skipped = {report.nodeid: _reason(report) for report in terminalreporter.stats.get("skipped", [])}
    line = plugin.line(list(skipped.values()))  # a module that skips itself does so in every worker
    if line:
        terminalreporter.write_line(line)
