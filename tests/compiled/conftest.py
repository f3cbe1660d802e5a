"""A folder of kernels of its own, and modules written for one test."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from surgsim.compiled import cache, identity
from surgsim.compiling import listening


class Workshop:
    """Writes and imports modules, and tells what was compiled."""

    def __init__(self, root: Path) -> None:
        self.kept = root / "kept"
        self.compiled: list[str] = []
        self._root = root

    def write(self, **modules: str) -> None:
        """Write `NAME.py` for each text."""
        for name, text in modules.items():
            (self._root / f"{name}.py").write_text(text, encoding="utf-8")

    def run(self, *names: str):
        """Import the modules as a new process would, and return the last one."""
        self.compiled.clear()
        cache._RESULTS.clear()
        identity.file_hash.cache_clear()
        for name in names:
            sys.modules.pop(name, None)
            spec = importlib.util.spec_from_file_location(name, self._root / f"{name}.py")
            module = importlib.util.module_from_spec(spec)
            sys.modules[name] = module
            source = (self._root / f"{name}.py").read_text(encoding="utf-8")
            exec(compile(source, spec.origin, "exec"), vars(module))  # no .pyc that hides an edit
        return module

    def process(self, code: str, inlined: int) -> str:
        """What another process prints that runs `code`, and inlines kernels of up to so many bytes."""
        head = (
            "import sys, pathlib; from surgsim.compiled import cache, library\n"
            f"cache.places = lambda: (pathlib.Path({str(self.kept)!r}),)\n"
            f"library.LARGEST_INLINED_BYTES = {inlined}\n"
            f"sys.path.insert(0, {str(self._root)!r})\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", head + code], capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    def entries(self) -> list[Path]:
        """What is kept of kernels."""
        return [path for path in self.files() if cache.ENTRANCE not in path.name]

    def files(self) -> list[Path]:
        """What is kept of kernels and of their entrances."""
        return sorted(self.kept.glob(f"*{cache.SUFFIX}"))


@pytest.fixture
def workshop(tmp_path, monkeypatch):
    made = Workshop(tmp_path)
    monkeypatch.setattr(cache, "places", lambda: (made.kept,))
    before = set(sys.modules)

    def told(compiling):
        if compiling.ended:
            made.compiled.append(compiling.kernel.rpartition(".")[2])

    with listening(told):
        yield made
    for name in set(sys.modules) - before:
        if getattr(sys.modules[name], "__file__", None) and str(tmp_path) in str(sys.modules[name].__file__):
            del sys.modules[name]
