"""How worker processes begin.

A fresh interpreter takes seconds to import what a run needs. On Linux a server process imports it once, with
one thread and nothing else done, and every worker is a fork of it; elsewhere each begins afresh.
"""

import multiprocessing
import os
import sys
from functools import lru_cache
from multiprocessing.context import ForkServerContext, SpawnContext
from typing import Any

_READ_AT_IMPORT = ("PYTHON", "NUMBA_", "MUJOCO_", "OMP_", "OPENBLAS_", "MKL_")
_IMPORTED = ["surgsim.compare.job", "surgsim.recording.write", "surgsim.simulate.loop"]


def worker_context() -> ForkServerContext | SpawnContext:
    """The context for new workers: forks of the server, if they would find what it found when it began."""
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    return _forks() if _surroundings() == _of_the_server() else multiprocessing.get_context("spawn")


@lru_cache(maxsize=1)
def _forks() -> ForkServerContext:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_IMPORTED)
    return context


@lru_cache(maxsize=1)
def _of_the_server() -> Any:
    return _surroundings()


def _surroundings() -> Any:
    """What decides on the packages that an interpreter finds, and on how they behave once imported."""
    read = {name: value for name, value in os.environ.items() if name.startswith(_READ_AT_IMPORT)}
    return tuple(sys.path), read, tuple(sys.warnoptions)
