"""A folder of kernels of its own, and modules written for one test."""

import importlib.util
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
        identity.file_hash.cache_clear()
        for name in names:
            sys.modules.pop(name, None)
            spec = importlib.util.spec_from_file_location(name, self._root / f"{name}.py")
            module = importlib.util.module_from_spec(spec)
            sys.modules[name] = module
            source = (self._root / f"{name}.py").read_text(encoding="utf-8")
            exec(compile(source, spec.origin, "exec"), vars(module))  # no .pyc that hides an edit
        return module

    def entries(self) -> list[Path]:
        """What is kept."""
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
