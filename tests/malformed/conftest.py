"""One judge of every refusal: exit 2, nothing on stdout, one line on stderr, in bounded time."""

import time
from collections.abc import Callable

import pytest

from surgsim.cli.main import main

LONGEST_S = 10.0
LONGEST_LINE = 1200


@pytest.fixture
def refused(capfd, monkeypatch, tmp_path) -> Callable[..., str]:
    """Runs a command in an empty folder and returns its one line, without the program's name."""
    monkeypatch.chdir(tmp_path)

    def judge(*words: object) -> str:
        began = time.monotonic()
        status = main([str(word) for word in words])
        took_s = time.monotonic() - began
        out, error = capfd.readouterr()
        assert status == 2, f"exit {status}: {out[:300]}{error[:300]}"
        assert out == ""
        assert error.startswith("surgsim: "), error[:300]
        assert error.endswith("\n"), error[:300]
        line = error.removeprefix("surgsim: ").removesuffix("\n")
        assert line.isprintable(), line
        assert len(line) <= LONGEST_LINE, len(line)
        assert took_s < LONGEST_S
        return line

    return judge
