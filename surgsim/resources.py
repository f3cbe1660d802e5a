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


def run_module(
    name: str,
    *words: str,
    timeout_s: float,
    given: bytes = b"",
    environment: Mapping[str, str] | None = None,
) -> subprocess.CompletedProcess[bytes]:
    """Run the module `name` as a program of its own, which may crash or hang without harm to this process.

    It imports from where this process does, and nothing from the working folder because it is that.

    Args:
        name: The module.
        words: Its arguments.
        timeout_s: After how long it is ended [s].
        given: What it reads on standard input.
        environment: Its environment variables; None: those of this process.

    Raises:
        OSError: If it cannot be started.
        subprocess.TimeoutExpired: If it takes too long.
    """
    paths = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
    return subprocess.run(
        [sys.executable, "-P", "-m", name, *words],
        input=given,
        env={**(os.environ if environment is None else environment), "PYTHONPATH": paths},
        capture_output=True,
        timeout=timeout_s,
        check=False,
    )
