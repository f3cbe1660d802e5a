"""What is shipped beside the code, in a checkout and in a wheel, and modules run as programs of their own."""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def resource_dir(name: str) -> Path:
    """Folder `name` (`assets`, `scenarios`, `examples`): inside the wheel, else at the checkout's top level.

    Of the examples the wheel has the reader of external controllers alone.
    """
    packed = _PACKAGE / "_data" / name
    return packed if packed.is_dir() else _PACKAGE.parent / name


def cores() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1  # macOS


def module_program(
    name: str, *words: str, environment: Mapping[str, str] | None = None
) -> tuple[list[str], dict[str, str]]:
    """Command and environment that run the module `name` as a program of its own.

    It imports from where this process does, and nothing from the working folder because it is that.

    Args:
        name: The module.
        words: Its arguments.
        environment: Its environment variables; None: those of this process.
    """
    paths = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
    given = os.environ if environment is None else environment
    return [sys.executable, "-P", "-m", name, *words], {**given, "PYTHONPATH": paths}


def run_module(
    name: str,
    *words: str,
    timeout_s: float,
    given: bytes = b"",
    environment: Mapping[str, str] | None = None,
) -> subprocess.CompletedProcess[bytes]:
    """Run the module `name` as a program of its own, which may crash or hang without harm to this process.

    Args:
        name: The module.
        words: Its arguments.
        timeout_s: After how long it is ended [s].
        given: What it reads on standard input.
        environment: As for `module_program`.

    Raises:
        OSError: If it cannot be started.
        subprocess.TimeoutExpired: If it takes too long.
    """
    command, variables = module_program(name, *words, environment=environment)
    return subprocess.run(
        command,
        input=given,
        env=variables,
        capture_output=True,
        timeout=timeout_s,
        check=False,
    )
