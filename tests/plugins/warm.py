"""Commands that need not start first: each runs in a process of its own, a fork of one that is warm.

More than half of what a short command takes is imports and the loading of kernels. A test of what a command
does, rather than of how it starts, asks for the fixture `warm`.
"""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest


class WarmCommand:
    """A command that runs, or has run: as much of `subprocess.Popen` as tests use.

    Attributes:
        pid: Number of its process.
        returncode: Its exit status; None as long as nobody knows that it has ended.
    """

    def __init__(self, status: int) -> None:
        """The command whose number, and later its exit status, come through the pipe `status`."""
        self._status = open(status, encoding="ascii")  # noqa: SIM115
        number = self._status.readline()
        assert number, "the warm process has ended: its errors are above"
        self.pid = int(number)
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Its exit status; None while it runs."""
        return self._look(0.0)

    def wait(self, timeout: float | None = None) -> int:
        """Its exit status, when it has ended.

        Raises:
            subprocess.TimeoutExpired: If it does not end in time.
        """
        status = self._look(timeout)
        if status is None:
            raise subprocess.TimeoutExpired("surgsim", timeout or 0.0)
        return status

    def _look(self, patience_s: float | None) -> int | None:
        if self.returncode is None and select.select([self._status], [], [], patience_s)[0]:
            self.returncode = int(self._status.readline())
            self._status.close()
        return self.returncode


class Warm:
    """What starts commands in processes that are warm."""

    def __init__(self) -> None:
        """Start the process that they are forks of; the first command waits until it is warm."""
        self._requests, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        server = Path(__file__).with_name("warm_server.py")
        self._server = subprocess.Popen(
            [sys.executable, "-W", "error", str(server), str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
        )
        theirs.close()

    def start(
        self,
        words: Sequence[str],
        streams: Sequence[int],
        folder: Path,
        environment: Mapping[str, str],
        terminal: bool = False,
        strict: bool = True,
    ) -> WarmCommand:
        """Start `surgsim` with `words` in `folder`.

        Args:
            words: Its arguments.
            streams: Its input, its output and its errors; they stay open here.
            folder: Where it runs.
            environment: All its variables.
            terminal: Whether its input is a terminal, which is to be its controlling one.
            strict: Whether a warning is an error.
        """
        asked = {
            "words": list(words),
            "folder": str(folder),
            "environment": dict(environment),
            "terminal": terminal,
            "strict": strict,
        }
        told, status = os.pipe()
        socket.send_fds(self._requests, [json.dumps(asked).encode()], [*streams, status])
        os.close(status)
        return WarmCommand(told)

    def run(
        self, words: Sequence[str], folder: Path, timeout_s: float = 100.0, **variables: str
    ) -> subprocess.CompletedProcess[str]:
        """`surgsim` with `words`, when it has ended; `variables` are added to its environment."""
        with (
            open(os.devnull, encoding="utf-8") as nothing,
            tempfile.TemporaryFile() as out,
            tempfile.TemporaryFile() as error,
        ):
            streams = [stream.fileno() for stream in (nothing, out, error)]
            command = self.start(words, streams, folder, {**os.environ, **variables})
            try:
                command.wait(timeout_s)
            except subprocess.TimeoutExpired:
                os.kill(command.pid, signal.SIGKILL)
                command.wait()
                raise
            texts = []
            for stream in (out, error):
                stream.seek(0)
                texts.append(stream.read().decode())
        return subprocess.CompletedProcess(["surgsim", *words], command.returncode, *texts)

    def close(self) -> None:
        """End the process that commands are forks of."""
        self._requests.close()
        self._server.wait(timeout=60)


@pytest.fixture(scope="session")
def warm() -> Iterator[Warm]:
    """What starts commands in processes that are warm."""
    server = Warm()
    yield server
    server.close()
